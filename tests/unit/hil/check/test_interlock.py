import json
from datetime import timedelta

import pytest

from hil.assembly.rig import load_rig
from hil.check import records
from hil.check.checklist import Checklist
from hil.check.interlock import FRESH, NotClearedError
from hil.check.judge import Outcome
from kernel.toml_errors import ConfigError
from tests.unit.hil.check.cleared import AUTOPILOT, ONE_QUESTION, Site, later, real_car
from vehicle.px4.driver.arming import Arming, Identity

HOUR = 3600.0
SIM = load_rig("sim")


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path)


def refused(site, **more) -> str:
    with pytest.raises(NotClearedError) as error:
        site.clear(**more)
    assert len(str(error.value).splitlines()) == 1
    return str(error.value)


def test_a_simulated_rig_needs_no_checklist(site):
    assert site.clear(SIM, policy="planner").manifest() == {"kind": "simulated"}


def test_recent_signed_go_clears_and_is_written_to_the_manifest(site):
    path = site.go()
    table = site.clear(now=later(300)).manifest()
    assert table["kind"] == "checklist"
    assert table["record"] == str(path)
    assert table["operator"] == "Ann"
    assert table["sha256"] == json.loads(path.read_text())["sign_off"]["sha256"]
    assert table["autopilot"] == AUTOPILOT.table()
    json.dumps(table)


def test_go_binds_the_run_to_its_autopilot(site):
    site.go()
    assert site.clear().arming == AUTOPILOT
    assert site.clear(SIM, policy="planner").arming == Arming()


@pytest.mark.parametrize("autopilot", [{}, Arming().table(), Arming(Identity(firmware="1.17.0")).table(), {"uid": 3}])
def test_go_without_the_autopilots_uid_does_not_clear_a_real_one(site, autopilot):
    site.go(autopilot=autopilot)
    assert "does not say which autopilot it is for" in refused(site)


def test_rig_without_a_real_autopilot_needs_no_uid(site):
    car = real_car(preflight=site.rig.preflight)
    site.go(rig=car, autopilot={})
    assert site.clear(car).kind == "checklist"


def test_marginal_items_are_named_in_the_manifest(site):
    site.go(outcome=Outcome.MARGINAL)
    assert site.clear().manifest()["marginal"] == ("manual.well",)


def test_no_record_is_refused_with_the_command_to_run(site):
    told = refused(site, scenario="hard-i", policy="planner")
    assert "no preflight record" in told
    command = f"perch-hil check {site.rig.preflight} --rig field --scenario hard-i --policy planner"
    assert command in told


OTHER_LIST = Checklist.model_validate(
    {"title": "other", "kind": "preflight", "group": [{"title": "g", "item": [{"ask": "Sure?"}]}]}
)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        ({"sign": False}, "is not signed off"),
        ({"outcome": Outcome.FAIL}, "is a no-go"),
        ({"outcome": Outcome.UNKNOWN}, "is incomplete"),
        ({"when": later(-4 * HOUR - 60)}, "a go lasts 4 h"),
        ({"when": later(600)}, "in the future"),
        ({"name": "other"}, "another rig: other, not field"),
        ({"scenario": "simple-i"}, "another scenario class: simple, not mine"),
        ({"rig": SIM}, "another rig: its file was changed since"),
        ({"policy": "planner-analytic"}, "another policy: planner-analytic, not policy.onnx"),
        ({"checklist": OTHER_LIST}, 'another checklist: the rig wants "one" as its file is now'),
        ({"checklist": OTHER_LIST.model_copy(update={"kind": "postflight"})}, "no preflight record"),
        ({"checklist": OTHER_LIST.model_copy(update={"kind": "other"})}, "no preflight record"),
    ],
    ids=str,
)
def test_mismatching_record_is_refused_with_the_reason(site, made, told):
    site.go(**made)
    assert told in refused(site)


def test_one_go_clears_all_published_scenarios_of_its_class(site):
    site.go(scenario="hard-i")
    assert site.clear(scenario="hard-ii").kind == "checklist"
    assert "another scenario class: hard, not normal" in refused(site, scenario="normal-i")


def test_rig_without_a_list_of_its_own_wants_the_projects_preflight(site):
    rig = site.rig.model_copy(update={"preflight": "preflight"})
    site.go(rig=rig)
    assert 'another checklist: the rig wants "Preflight"' in refused(site, rig=rig)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (ONE_QUESTION.replace("preflight", "other"), "whose kind is another"),
        ('title = "x"\n', "list.toml"),
        (None, "list.toml: cannot be read"),
    ],
)
def test_unusable_list_of_the_rig_is_a_refusal(site, content, told):
    site.go()
    path = site.folder / "list.toml"
    path.write_text(content) if content else path.unlink()
    assert told in refused(site)


def test_an_edited_record_is_refused(site):
    path = site.go(outcome=Outcome.FAIL)
    path.write_text(path.read_text().replace('"FAIL"', '"PASS"'))
    assert "changed after it was signed off" in refused(site)


def test_older_go_clears_beside_a_newer_one_for_another_scenario(site):
    site.go(when=later(-HOUR))
    site.go(scenario="simple-i", when=later(-60))
    assert site.clear().signed_utc == "2026-01-02T11:00:00Z"


def test_override_needs_a_reason_and_is_kept_with_the_refusal(site):
    cleared = site.clear(override="tethered, motors\n removed")
    table = cleared.manifest()
    assert table["kind"] == "override"
    assert table["override_reason"] == "tethered, motors removed"
    assert "no preflight record" in table["refused_because"]
    assert cleared.remark.startswith("armed by override: ")
    assert cleared.arming == Arming()


@pytest.mark.parametrize("reason", ["", "  ", "yes"])
def test_override_without_a_reason_is_refused_whether_there_is_a_go_or_not(site, reason):
    for _ in range(2):
        with pytest.raises(ConfigError, match=r"--override-check .*in words"):
            site.clear(override=reason)
        site.go()


def test_unneeded_override_is_told_and_leaves_the_clearance_by_checklist(site):
    path = site.go()
    cleared = site.clear(override="just in case")
    assert (cleared.kind, cleared.arming) == ("checklist", AUTOPILOT)
    assert cleared.manifest()["override_reason"] == "just in case"
    assert cleared.remark == f"--override-check was not needed: there is a go, {path}"
    assert "a simulated rig needs no go" in site.clear(SIM, policy="planner", override="just in case").remark
    assert site.clear().remark == ""


def test_refusal_names_the_newest_record_of_the_rig(site):
    site.go(when=later(-9 * HOUR))
    site.go(when=later(-6 * HOUR))
    site.go(name="other", sign=False, when=later(-60))
    assert "1.json: is 6.0 h old" in refused(site)


# the clocks


def test_date_set_back_does_not_revive_an_old_go(site):
    site.go(when=later(0, "boot", 1000.0))
    five_hours_on = 1000.0 + 5 * HOUR
    assert "is 5.0 h old" in refused(site, now=later(60, "boot", five_hours_on))


def test_date_set_forward_after_the_go_does_not_end_it(site):
    site.go(when=later(0, "boot", 1000.0))
    assert site.clear(now=later(9 * HOUR, "boot", 1600.0)).kind == "checklist"


def test_go_of_before_a_restart_is_judged_by_the_date(site):
    site.go(when=later(0, "boot", 90_000.0))
    assert site.clear(now=later(600, "other boot", 10.0)).kind == "checklist"
    late = FRESH + timedelta(minutes=1)
    assert "h old" in refused(site, now=later(late.total_seconds(), "other boot", 10.0))


def test_go_that_claims_a_later_time_since_the_start_is_refused(site):
    site.go(when=later(0, "boot", 5000.0))
    assert "signed off in the future" in refused(site, now=later(0, "boot", 10.0))


# odd files


@pytest.mark.parametrize(
    "change",
    [
        {"subject": []},
        {"subject": {"kind": "preflight", "rig": "field", "policy": {"sha256": 5}, "rig_sha256": float("inf")}},
        {"subject": {"kind": "preflight", "rig": "field", "policy": 3, "code": ["x"]}},
        {"started_utc": None},
        {"sign_off": {"operator": "Ann", "utc": "9999-12-31T23:59:59-12:00", "sha256": "0"}},
        {"sessions": 3},
        {"autopilot": "none"},
    ],
    ids=str,
)
def test_invalid_file_beside_a_valid_go_does_not_prevent_arming(site, change):
    table = json.loads(site.go().read_text())
    (site.checks / "odd.json").write_text(json.dumps({**table, **change}))
    assert site.clear().kind == "checklist"


@pytest.mark.parametrize("utc", ["9999-12-31T23:59:59-12:00", "0001-01-01T00:00:00+14:00", "soon"])
def test_go_signed_at_an_impossible_time_is_refused(site, utc):
    path = site.go()
    record = records.read(path)
    assert record.sign_off is not None
    record.sign_off["utc"] = utc
    record.sign_off["sha256"] = records._digest(record.content(), record.sign_off)
    records.write(path, record)
    assert any(text in refused(site) for text in ("unreadable time", "in the future", "h old"))
