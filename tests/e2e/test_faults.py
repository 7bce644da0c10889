"""Whole flights with faults: repeatable, classified, and gone from the rest of the flight."""

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.assembly.plan import Plan
from hil.cli.main import app
from hil.host.flight import fly
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.scoring.flight_class import ABORTED, CLASSES, MISSED, UNSAFE
from hil.scoring.verdict import NOT_HELD
from scenarios.faults import FaultTable
from tests.paths import ROOT

CODE = provenance.Code("git", "0.1.0", "a" * 40)


def table(kind, **values):
    return FaultTable.model_validate({"kind": kind, "at": 0.3, **values})


def flown(out, *faults, seed=0, scenario="simple-i", policy="planner"):
    plan = Plan(scenario, "sim", policy, "model", faults=faults)
    return fly(
        plan.scenario, plan.rig, plan.make_policy(), seed, policy_name=policy, rig_name="sim", pictures="none",
        out=out, code=CODE, progress=lambda *_: None,
    )  # fmt: skip


def test_flight_with_faults_is_byte_identical(tmp_path):
    faults = (table("mavlink.loss", share=0.2), table("detector.outlier"), table("policy.missed", share=0.2))
    first, second = (flown(tmp_path / name, *faults) for name in "ab")
    assert first.run.recording.read_bytes() == second.run.recording.read_bytes()
    assert first.flight_class == second.flight_class


def test_flight_is_drawn_as_without_the_fault_until_it_begins(tmp_path):
    plain = flown(tmp_path / "plain")
    faulty = flown(tmp_path / "faulty", table("camera.dropped", at=0.5, share=0.5))

    def before(flight):
        start = next(
            m.attempt_start_ns
            for _, _, m in Recording(flight.run.recording).messages(["run/stage"])
            if m.attempt_start_ns
        )
        return [
            repr(m) for log, _, m in Recording(flight.run.recording).messages(["truth/vehicle"]) if log < start + 4e8
        ]

    assert before(plain) == before(faulty)


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (table("policy.nan"), "command is not finite"),
        (table("policy.frozen"), "command has not changed for 0.20 s"),
        (table("mavlink.down"), ""),
        (table("service.killed"), ""),
        (table("service.killed", service="referee"), "director has not published run/stage"),
        (table("estimator.jump", x=3.0), "odometry jumped"),
        (table("camera.dropped"), ""),
    ],
)
def test_attempt_that_loses_what_it_needs_is_aborted_and_lands(fault, why, tmp_path):
    found = flown(tmp_path, fault).flight_class
    assert found is not None and found.name == ABORTED, found
    assert any(why in text for text in found.why), found


def test_board_that_stands_does_not_move_when_motion_capture_jumps(tmp_path):
    flight = flown(tmp_path, table("mocap.jump", **{"for": 0.5}))
    places = [m.position for _, _, m in Recording(flight.run.recording).messages(["truth/board"])]
    assert max(math.dist(place, places[0]) for place in places) < 0.01
    texts = [m.text for _, _, m in Recording(flight.run.recording).messages(["event"])]
    assert any("the board's pose has jumped by 1.00 m" in text for text in texts)


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (table("camera.dropped", at="distance < 2.0"), "off where it is believed to be"),
        (table("policy.frozen", at="distance < 1.5"), "command has not changed for 0.12 s"),
    ],
)
def test_vehicle_in_front_of_a_fast_board_stops_before_it(fault, why, tmp_path):
    found = flown(tmp_path, fault, seed=2, scenario="hard-i", policy="vision").flight_class
    assert found is not None and found.name == ABORTED, found
    assert any(why in text for text in found.why), found


def test_vehicle_whose_magnet_does_not_hold_recovers_and_lands(tmp_path):
    flight = flown(tmp_path, table("magnet.off"))
    assert flight.flight_class is not None
    assert (flight.flight_class.name, flight.flight_class.why) == (MISSED, (NOT_HELD,))
    assert not flight.score.attached and NOT_HELD in flight.score.reasons


def test_fault_whose_condition_never_comes_true_does_not_count(tmp_path):
    flight = flown(tmp_path, table("camera.frozen", at="height > 50"))
    assert flight.flight_class is not None and flight.flight_class.not_begun == ("camera.frozen (height > 50)",)
    assert any("the fault did not happen" in reason for reason in flight.score.reasons)


@pytest.mark.slow
def test_shipped_faults_end_in_one_class_each_and_none_is_unsafe(tmp_path):
    result = CliRunner().invoke(
        app,
        ["campaign", "simple-i", "--policy", "planner", "--camera", "model", "--seeds", "0..0", "--json",
         "--faults", str(ROOT / "scenarios" / "faults.toml"), "--keep", "unsafe", "--jobs", "2",
         "--out", str(tmp_path / "c")],
    )  # fmt: skip
    report = json.loads(result.stdout.splitlines()[-1])
    assert len(report["faults"]) >= 25
    assert all(sum(row[name] for name in (*CLASSES, "not counted")) == 1 for row in report["faults"])
    assert [row["fault"] for row in report["faults"] if row[UNSAFE]] == [] and result.exit_code == 0
    page = Path(report["page"]).read_text()
    assert "mavlink.down" in page and "magnet.off" in page


def test_replay_of_a_flight_with_faults_gives_the_same(tmp_path):
    from hil.host.replay import replay_run

    flight = flown(tmp_path, table("camera.late"), table("detector.mirrored"), table("clock.step"))
    found = replay_run(flight.run.path)
    assert found.same, found.lines()
