"""The table of kinds: what is refused, and that every kind does something where it is placed."""

import pytest

from hil.assembly.node_table import fault_setting
from hil.assembly.plan import Plan
from hil.assembly.rig import load_rig
from hil.faults.kinds import KINDS, check_faults, read_parameters
from kernel.toml_errors import ConfigError
from scenarios.faults import FaultTable

SIM, MODEL = load_rig("sim"), Plan("simple-i", "sim", None, "model").rig


def table(kind, **values):
    return FaultTable.model_validate({"kind": kind, **values})


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_described_and_acts_with_its_defaults(kind):
    assert KINDS[kind].__doc__ and "." in kind
    one = KINDS[kind]
    setting = fault_setting(SIM, live=True)
    check_faults([table(kind)], setting)
    assert set(one.places(read_parameters(table(kind)), setting)) <= set(setting.nodes)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            table("camera.frozn"),
            'there is no fault "camera.frozn"; did you mean "camera.frozen"\\? Known: camera.frozen',
        ),
        (table("mavlink.loss", shar=0.5), 'fault mavlink.loss: unknown key "shar"; did you mean "share"\\?'),
        (table("mavlink.loss", share=1.5), "share.*less than or equal to 1"),
        (table("camera.dark"), "has none: give --camera pictures"),
        (table("service.killed", service="brian"), 'no service "brian"; did you mean "brain"\\?'),
        (table("disk.full"), "only a live run has"),
    ],
)
def test_fault_that_cannot_act_is_refused(wrong, message):
    with pytest.raises(ConfigError, match=message):
        check_faults([wrong], fault_setting(MODEL, live=False))


def test_faults_of_simulated_devices_are_refused_on_real_ones():
    field = load_rig("field")
    for kind in ("motor.loss", "car.dead"):
        with pytest.raises(ConfigError, match="this rig has a real one"):
            check_faults([table(kind)], fault_setting(field, live=True))


def test_plan_refuses_an_unknown_fault(tmp_path):
    with pytest.raises(ConfigError, match="there is no fault"):
        Plan("simple-i", "sim", None, "model", faults=[table("nothing")])
