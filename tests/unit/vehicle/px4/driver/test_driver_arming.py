"""The driver arms only the autopilot that was checked, as it was checked: which one it is and what it holds is asked
anew just before."""

from types import SimpleNamespace

import pytest

from tests.unit.vehicle.px4.driver.driver_bench import Bench
from vehicle.px4.driver.arming import Arming, Identity, identity_of, same_value
from vehicle.px4.sim.messages import UID

SITL = Identity(f"{UID:016x}", "1.17.0 000000c4d12af1d6")
HELD = {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 4, "NAV_RCL_ACT": 2}


def waiting(**config):
    return Bench(arm=False, **config).to("ready")


def test_checked_autopilot_is_armed_and_named():
    bench = waiting()
    bench.link.allow_arming(Arming(SITL, HELD))
    bench.to("verify").to("hover")
    assert bench.reported(f"autopilot UID {SITL.uid}, firmware {SITL.firmware}")
    assert bench.link.identity == SITL
    assert bench.link.parameters["NAV_RCL_ACT"] == 2, "what a go is bound to is recorded too"


@pytest.mark.parametrize(
    ("arming", "told"),
    [
        (Arming(Identity("4954"), {}), f"its UID is {SITL.uid}, the checked autopilot's was 4954"),
        (Arming(Identity(SITL.uid, "1.16.0"), {}), f"its firmware is {SITL.firmware}, checked was 1.16.0"),
        (Arming(SITL, {"NAV_RCL_ACT": 3}), "NAV_RCL_ACT is 2, checked was 3"),
        (Arming(parameters={"NO_SUCH": 3.5}), "it does not tell its NO_SUCH, checked was 3.5"),
    ],
    ids=["UID", "firmware", "value", "unknown parameter"],
)
def test_another_autopilot_or_value_is_not_armed_and_the_difference_is_told(arming, told):
    bench = waiting(tries=3)
    bench.link.allow_arming(arming)
    bench.to("failed")
    assert bench.reported("not armed, this is not as it was checked: ") and bench.reported(told)
    assert bench.seconds < 20.0
    assert not bench.sim.flight.armed


def test_parameter_changed_after_it_was_read_is_found_at_arming():
    bench = waiting()
    assert bench.link.parameters["COM_OF_LOSS_T"] == pytest.approx(0.3)
    bench.sim.flight.parameters.values["COM_OF_LOSS_T"] = 1.0
    bench.link.allow_arming(Arming(SITL, HELD))
    bench.to("failed")
    assert bench.reported("COM_OF_LOSS_T is 1, checked was 0.3")
    assert not bench.sim.flight.armed


def test_silent_autopilot_is_not_armed_within_bounded_time():
    bench = waiting(tries=3)
    bench.link.allow_arming(Arming(SITL, HELD))
    bench.sim.receiver._request = lambda port, id: 3
    bench.sim.receiver._handlers["PARAM_REQUEST_READ"] = lambda *_: None
    bench.to("failed")
    assert bench.reported("its UID is unknown") and bench.reported("it does not tell its COM_OF_LOSS_T")


def test_without_conditions_any_autopilot_is_armed_also_one_that_does_not_tell_its_uid():
    bench = waiting(tries=2)
    bench.sim.receiver._request = lambda port, id: 3
    bench.link.allow_arming(Arming())
    bench.to("hover")
    assert bench.reported("autopilot UID unknown, firmware unknown")


def test_driver_that_arms_by_itself_verifies_nothing():
    bench = Bench().to("ready")
    bench.link.allow_arming(Arming(Identity("another"), {}))
    bench.to("hover")
    assert "verify" not in [phase for _, phase in bench.phases]


def test_conditions_survive_their_table():
    assert Arming.of(Arming(SITL, HELD).table()) == Arming(SITL, HELD)
    assert Arming.of(Arming().table()) == Arming()


@pytest.mark.parametrize(
    "table",
    [None, 3, [], {}, {"uid": "", "firmware": ""}, {"uid": 1, "firmware": "", "parameters": {}},
     {"uid": "", "firmware": "", "parameters": {"A": "1"}}, {"uid": "", "firmware": "", "parameters": {"A": True}},
     {"uid": "", "firmware": "", "parameters": {"A": float("nan")}}],
    ids=str,
)  # fmt: skip
def test_table_that_is_no_condition_raises(table):
    with pytest.raises(ValueError, match="no conditions for arming"):
        Arming.of(table)


def test_identity_prefers_the_long_uid_and_knows_none():
    version = SimpleNamespace(
        uid=0x1234, uid2=(0,) * 18, flight_sw_version=0x010F03FF, flight_custom_version=(0xAB,) + (0,) * 7
    )
    assert identity_of(version) == Identity("0000000000001234", "1.15.3 ab00000000000000")
    version.uid2 = (1,) + (0,) * 17
    assert identity_of(version).uid == "01" + "00" * 17
    version.uid, version.uid2, version.flight_custom_version = 0, (0,) * 18, (0,) * 8
    assert identity_of(version) == Identity("", "1.15.3")


def test_whole_numbers_are_compared_exactly_and_others_as_px4_keeps_them():
    assert not same_value(2_147_483_646, 2_147_483_647)
    assert same_value(0.3, 0.30000001192092896)
    assert not same_value(0.3, 0.30001)
    assert same_value(4, 4.0)
