import json
from datetime import UTC, datetime, timedelta

import pytest

from hil.assembly.rig import load_rig
from hil.bench.devices import subject
from hil.check import records
from hil.check.checklist import Checklist
from hil.check.interlock import NotClearedError, clear_to_arm
from hil.check.judge import Outcome
from hil.check.session import new_record
from scenarios.spec import load

NOW = datetime(2026, 1, 2, 12, 0, 0, tzinfo=UTC)
SIM = load_rig("sim")
# A rig with a real car, whatever kinds of links this program has by now
REAL = SIM.model_copy(update={"groundcar": SIM.groundcar.model_copy(update={"kind": "can"})})


@pytest.fixture
def go(tmp_path):
    def make(rig=REAL, policy="planner", scenario="hard-i", age=timedelta(minutes=5), outcome=Outcome.PASS, **more):
        kind = more.pop("kind", "preflight")
        made = Checklist.model_validate(
            {"title": "made up", "kind": kind, "group": [{"title": "one", "item": [{"ask": "Well?"}]}]}
        )
        record = new_record(made, subject(more.pop("name", "bench"), rig, policy, load(scenario)))
        record.entries[0].outcome = outcome
        record.started_utc = records.iso(NOW - age)
        if more.pop("sign", True):
            record.sign("Ann", NOW - age)
        path = tmp_path / f"{len(list(tmp_path.glob('*.json')))}.json"
        records.write(path, record)
        return path

    return make


def clear(folder, rig=REAL, policy="planner", scenario="hard-i", name="bench", **more):
    return clear_to_arm(name, rig, policy, load(scenario), folder=folder, now=NOW, **more)


def test_a_simulated_rig_needs_no_checklist(tmp_path):
    assert clear(tmp_path / "none", SIM).manifest() == {"kind": "simulated"}


def test_recent_signed_go_clears_and_is_written_to_the_manifest(go, tmp_path):
    path = go()
    table = clear(tmp_path).manifest()
    assert table["kind"] == "checklist"
    assert table["record"] == str(path)
    assert table["operator"] == "Ann"
    assert table["sha256"] == json.loads(path.read_text())["sign_off"]["sha256"]
    json.dumps(table)


def test_marginal_items_are_named_in_the_manifest(go, tmp_path):
    go(outcome=Outcome.MARGINAL)
    assert clear(tmp_path).manifest()["marginal"] == ("manual.well",)


def test_no_record_is_refused_with_the_command_to_run(tmp_path):
    with pytest.raises(NotClearedError) as error:
        clear(tmp_path)
    assert "no preflight record" in str(error.value)
    assert "perch-hil check preflight --rig bench --scenario hard-i --policy planner" in str(error.value)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        ({"sign": False}, "is not signed off"),
        ({"outcome": Outcome.FAIL}, "is a no-go"),
        ({"outcome": Outcome.UNKNOWN}, "is incomplete"),
        ({"age": timedelta(hours=4, minutes=1)}, "a go lasts 4 h"),
        ({"age": timedelta(minutes=-10)}, "in the future"),
        ({"name": "other"}, "another rig: other, not bench"),
        ({"scenario": "simple-i"}, "another scenario class: simple, not hard"),
        ({"rig": SIM}, "rig file: it was changed since"),
        ({"kind": "postflight"}, "no preflight record"),
        ({"kind": "other"}, "no preflight record"),
    ],
)
def test_mismatching_record_is_refused_with_the_reason(go, tmp_path, made, message):
    go(**made)
    with pytest.raises(NotClearedError, match=message):
        clear(tmp_path)


def test_one_go_clears_all_scenarios_of_its_class(go, tmp_path):
    go(scenario="hard-i")
    assert clear(tmp_path, scenario="hard-ii").kind == "checklist"
    with pytest.raises(NotClearedError, match="class"):
        clear(tmp_path, scenario="normal-i")


def test_a_rig_file_changed_since_is_refused(go, tmp_path):
    go()
    changed = REAL.model_copy(update={"gate": REAL.gate.model_copy(update={"speed": 12.0})})
    with pytest.raises(NotClearedError, match="changed since"):
        clear(tmp_path, changed)


def test_a_policy_file_changed_since_is_refused(go, tmp_path):
    policy = tmp_path / "p.onnx"
    policy.write_bytes(b"one")
    go(policy=str(policy))
    assert clear(tmp_path, policy=str(policy)).kind == "checklist"
    policy.write_bytes(b"two")
    with pytest.raises(NotClearedError, match="another policy"):
        clear(tmp_path, policy=str(policy))


def test_an_edited_record_is_refused(go, tmp_path):
    path = go(outcome=Outcome.FAIL)
    path.write_text(path.read_text().replace('"FAIL"', '"PASS"'))
    with pytest.raises(NotClearedError, match="changed after it was signed off"):
        clear(tmp_path)


def test_older_go_clears_beside_a_newer_one_for_another_scenario(go, tmp_path):
    go(age=timedelta(hours=1))
    go(scenario="simple-i", age=timedelta(minutes=1))
    assert clear(tmp_path).signed_utc == "2026-01-02T11:00:00Z"


def test_override_needs_a_reason_and_is_kept_with_the_refusal(tmp_path):
    for empty in ("", "  ", "yes"):
        with pytest.raises(NotClearedError, match="reason in words"):
            clear(tmp_path, override=empty)
    table = clear(tmp_path, override="tethered, motors\n removed").manifest()
    assert table["kind"] == "override"
    assert table["override_reason"] == "tethered, motors removed"
    assert "no preflight record" in table["refused_because"]


def test_unneeded_override_leaves_the_clearance_by_checklist(go, tmp_path):
    go()
    assert clear(tmp_path, override="just in case").kind == "checklist"


def test_refusal_names_the_newest_record_of_the_rig(go, tmp_path):
    go(age=timedelta(hours=9))
    go(age=timedelta(hours=6))
    go(name="other", sign=False, age=timedelta(minutes=1))
    with pytest.raises(NotClearedError, match=r"1\.json: is 6\.0 h old"):
        clear(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"subject": []},
        {"subject": {"kind": "preflight", "rig": "bench", "policy": {"sha256": 5}, "rig_sha256": float("inf")}},
        {"started_utc": None},
        {"sign_off": {"operator": "Ann", "utc": "9999-12-31T23:59:59-12:00", "sha256": "0"}},
        {"sessions": 3},
    ],
    ids=str,
)
def test_invalid_file_beside_a_valid_go_does_not_prevent_arming(go, tmp_path, change):
    table = json.loads(go().read_text())
    (tmp_path / "odd.json").write_text(json.dumps({**table, **change}))
    assert clear(tmp_path).kind == "checklist"


@pytest.mark.parametrize("utc", ["9999-12-31T23:59:59-12:00", "0001-01-01T00:00:00+14:00", "soon"])
def test_go_signed_at_an_impossible_time_is_refused(go, tmp_path, utc):
    path = go()
    record = records.read(path)
    record.sign_off["utc"] = utc
    record.sign_off["sha256"] = records._digest(record.content(), "Ann", utc)
    records.write(path, record)
    with pytest.raises(NotClearedError, match=r"unreadable time|in the future|h old"):
        clear(tmp_path)
