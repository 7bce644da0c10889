import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.contract.messages import VehicleParameters
from hil.recording import autopilot_parameters as ap
from hil.recording.recorder import Recorder
from hil.recording.runs import Run, RunError, write_json

NAMES = st.dictionaries(st.sampled_from(["COM_OF_LOSS_T", "MC_ROLL_P", "EKF2_HGT_REF", "MINE"]), st.floats(-1e6, 1e6))


def make(root: Path, name: str, *tables: dict[str, float], rig: str = "sim") -> Run:
    """A run folder in which these parameter tables were recorded one after the other."""
    (root / name).mkdir(parents=True)
    run = Run(root / name)
    write_json(root / name / "manifest.json", {"rig": {"name": rig}, "scenario": {"name": "hard-i"}})
    with Recorder(run.recording) as recorder:
        for now, held in enumerate(tables):
            recorder(now, ap.TOPIC, VehicleParameters(now, tuple(held), tuple(held.values())))
    return run


def test_manifest_holds_the_last_parameters_and_those_not_default(tmp_path):
    run = make(tmp_path, "a", {"COM_OF_LOSS_T": 1.0, "SYS_HAS_MAG": 1.0}, {"COM_OF_LOSS_T": float(np.float32(0.3))})
    ap.note_parameters(run)
    table = run.manifest["autopilot"]
    assert table["parameters"] == {"COM_OF_LOSS_T": 0.3, "SYS_HAS_MAG": 1}
    assert table["not_default"] == {"COM_OF_LOSS_T": 1.0}
    assert "v1.17" in table["defaults_of"]
    with pytest.raises(RunError, match="holds autopilot already"):
        ap.note_parameters(run)


def test_manifest_is_unchanged_when_the_autopilot_sent_no_parameters(tmp_path):
    run = make(tmp_path, "a")
    ap.note_parameters(run)
    assert ap.of_run(run.manifest) == {}
    run.recording.write_bytes(b"torn")
    before = (run.path / "manifest.json").read_bytes()
    ap.note_parameters(run)
    assert (run.path / "manifest.json").read_bytes() == before


def test_a_name_px4_does_not_have_is_not_default(tmp_path):
    assert ap.not_default({"MY_OWN": 2.0, "SYS_HAS_MAG": 1.0}) == [("MY_OWN", 2.0, None)]


@given(NAMES, NAMES)
def test_parameter_changes_list_only_differing_values(held, before):
    found = {c.name: (c.value, c.other) for c in ap.changes(held, before)}
    for name in {*held, *before}:
        both = name in held and name in before
        same = both and math.isclose(held[name], before[name], rel_tol=1e-6, abs_tol=1e-9)
        assert (name in found) is not same
        assert same or found[name] == (held.get(name), before.get(name))
    assert ap.changes(held, held) == []


@given(NAMES)
def test_parameter_table_round_trips_through_json_and_single_precision(held):
    single = {name: float(np.float32(value)) for name, value in held.items()}
    back = ap.of_run(json.loads(json.dumps({ap.TABLE: ap.table(single)}, allow_nan=False)))
    assert ap.changes(back, single) == []


@pytest.mark.parametrize(
    ("damaged", "left"),
    [(None, {}), ([], {}), ({"parameters": 3}, {}), ({"parameters": {"A": "x", "B": True, "C": 1.5}}, {"C": 1.5})],
)
def test_valid_rows_of_a_damaged_parameter_table_are_read(damaged, left):
    assert ap.of_run({"autopilot": damaged}) == left


def test_last_flight_is_the_newest_of_the_rig_with_parameters(tmp_path):
    for name, rig, tables in (
        ("1", "bench", [{"A": 1.0}]), ("2", "bench", [{"A": 2.0}]), ("3", "sim", [{"A": 3.0}]), ("4", "bench", []),
    ):  # fmt: skip
        ap.note_parameters(make(tmp_path, name, *tables, rig=rig))
    (tmp_path / "5").mkdir()
    (tmp_path / "5" / "manifest.json").write_text("torn")
    found = ap.last_flight(tmp_path, "bench")
    assert found is not None and found[0].path.name == "2" and found[1] == {"A": 2.0}
    assert ap.last_flight(tmp_path, "field") is None
