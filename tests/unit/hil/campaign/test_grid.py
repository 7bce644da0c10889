"""Jobs of a campaign: invalid ones are refused at the start, finished ones skipped."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.campaign import grid as campaign_grid
from hil.campaign.grid import Grid, check, left_to_do
from hil.recording.provenance import Code
from hil.recording.runs import SCORE, new_run, policy_identity, write_json
from scenarios.draw import MAX_SEED
from scenarios.faults import FaultTable

CODE = Code("git", "0.1.0", "a" * 40)
WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@pytest.fixture
def grid(tmp_path):
    return Grid(("simple-i", "hard-i"), ("planner", "planner-analytic"), range(3), "sim", "model", "none", tmp_path)


def flown(grid, job, outcome="success", state="finished", flight=None, **changes):
    """A run of `job` as a campaign leaves it."""
    plan = campaign_grid.plan_of(grid, job)
    scenario = {**plan.scenario.model_dump(mode="json"), "name": plan.scenario.name}
    run = new_run(
        grid.out, scenario={**scenario, **changes}, rig={**plan.rig.model_dump(mode="json"), "name": "sim"},
        seed=job.seed, host="lockstep", policy=policy_identity(job.policy), simulated=True, started_utc=WHEN, code=CODE,
    )  # fmt: skip
    if outcome:
        write_json(run.path / SCORE, {"outcome": outcome, **({"flight": flight} if flight else {})})
    run.finish(state, WHEN)
    return run


def test_without_a_rig_each_scenario_flies_on_its_own(grid):
    mixed = replace(grid, scenarios=("simple-i", "crazyflie-wall"), policies=("planner-analytic",), rig=None)
    assert {job.scenario: campaign_grid.plan_of(mixed, job).rig_name for job in check(mixed)} == {
        "simple-i": "sim", "crazyflie-wall": "crazyflie-sim",
    }  # fmt: skip


def test_jobs_are_ordered_by_seed_then_policy(grid):
    jobs = check(grid)
    assert len(jobs) == len(set(jobs)) == 12
    assert [job.policy for job in jobs[:2]] == ["planner", "planner-analytic"]
    assert jobs[0].seed == jobs[1].seed == 0 and jobs[0].scenario == jobs[5].scenario == "simple-i"


def test_policy_is_opened_once_however_many_plans_fly_it(grid):
    faults = tuple(FaultTable(name=f"{k} s", kind="camera.frozen", at=float(k)) for k in range(1, 6))
    grid = replace(grid, policies=("vision",), faults=faults)
    plans = [campaign_grid.plan_of(grid, job) for job in check(grid)]
    assert len(set(map(id, plans))) == 10
    assert len({id(plan.make_policy) for plan in plans}) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scenarios": ("hard-i", "hard-i")}, "scenario hard-i is given twice"),
        ({"policies": ("planner", "planner")}, "policy planner is given twice"),
        ({"policies": ("planer",)}, "no policy 'planer'"),
        ({"scenarios": ("hard-3",)}, "hard-i"),
        ({"rig": "field"}, "real devices"),
        ({"seeds": range(MAX_SEED, MAX_SEED + 2)}, "out of range"),
    ],
)
def test_invalid_campaign_is_refused_before_the_first_flight(grid, changes, message):
    with pytest.raises(ValueError, match=message):
        check(replace(grid, **changes))
    assert list(grid.out.iterdir()) == []


def test_jobs_with_a_run_in_the_folder_are_skipped(grid):
    jobs = check(grid)
    flown(grid, jobs[0])
    flown(grid, jobs[1], outcome="fail")  # a miss is a result
    flown(grid, jobs[2], outcome="incomplete")
    flown(grid, jobs[3], state="interrupted")
    flown(grid, jobs[4], outcome="")
    flown(grid, jobs[5], time_limit=3.0)  # of another content: another scenario
    (grid.out / "torn").mkdir()
    (grid.out / "torn" / "manifest.json").write_text("{")
    assert left_to_do(grid, jobs) == jobs[2:]
    assert left_to_do(replace(grid, camera="pictures"), jobs) == jobs
    assert left_to_do(replace(grid, out=grid.out / "absent"), jobs) == jobs


def test_policy_is_identified_by_the_content_of_its_file(grid, tmp_path):
    a, b = tmp_path / "a" / "p.onnx", tmp_path / "b" / "p.onnx"
    for path, content in ((a, b"one"), (b, b"one")):
        path.parent.mkdir()
        path.write_bytes(content)
    keys = {campaign_grid._key({}, {}, policy_identity(str(path)), 0) for path in (a, b)}
    assert len(keys) == 1
    b.write_bytes(b"two")
    assert campaign_grid._key({}, {}, policy_identity(str(b)), 0) not in keys


FAULTS = tuple(FaultTable(kind=kind) for kind in ("mavlink.down", "policy.nan"))


def test_every_fault_is_a_job_of_its_own_on_every_scenario_and_seed(grid):
    jobs = check(replace(grid, faults=FAULTS))
    assert len(jobs) == len(set(jobs)) == 24
    assert {job.fault for job in jobs} == {"mavlink.down", "policy.nan"}
    assert {job.seed for job in jobs[:8]} == {0}


def test_flight_with_a_fault_is_flown_once_it_has_a_class(grid):
    grid = replace(grid, faults=FAULTS)
    jobs = check(grid)
    flown(grid, jobs[0], outcome="incomplete", state="failed", flight={"class": "aborted and landed"})
    flown(grid, jobs[1], outcome="incomplete", state="failed")
    assert left_to_do(grid, jobs) == jobs[1:]


@given(st.recursive(st.integers() | st.text(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_job_key_is_independent_of_dict_order(value):
    def turned(value):
        if isinstance(value, dict):
            return {key: turned(value[key]) for key in reversed(value)}
        return [turned(part) for part in value] if isinstance(value, list) else value

    assert campaign_grid._key(value, {}, {}, 0) == campaign_grid._key(turned(value), {}, {}, 0)
