import json
import math

import pytest

from hil.contract.messages import BoardState, Contact, Detection, Event, Sent, Stage
from hil.scoring.score import ABORTED, Scorer, score_messages
from hil.scoring.verdict import NOT_HELD, verdict_word
from scenarios.spec import load

START = 2_000_000_000
CONTACT = 5_000_000_000


def board(stamp, speed):
    inclination = math.radians(70)
    tilt = (math.cos(inclination / 2), 0.0, -math.sin(inclination / 2), 0.0)
    return BoardState(stamp, (0.0, 0.0, 1.5), (speed, 0.0, 0.0), tilt, 0.0, speed, 0.0)


def detection(stamp, found=True, reason=""):
    return Detection(stamp, found, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.01, 0.01, (0,), (), reason, 0, 0)


def contact(stamp, outcome="success", reason="", attached=True, within=True):
    return Contact(stamp, outcome, reason, attached, within, 0.03, -0.04, math.radians(5.0), -0.5, 0.2)


def flight(verdict=None, *, stages=True):
    """A flight of 3 s: speed falls from 2.5 to 1.0, every picture is looked at, the last half second is blind."""
    messages = []
    for t in range(0, 6_000_000_000, 10_000_000):
        if stages:
            name = "lead" if t < START else "attempt"
            messages.append((t, "run/stage", Stage(t, name, START if t >= 1_000_000_000 else 0, 1_000_000_000)))
        speed = 9.0 if t < START else 2.5 - 0.5 * (t - START) / 1e9
        messages.append((t, "truth/board", board(t, max(speed, 1.0) if t <= CONTACT else 0.0)))
        messages.append((t, "mocap/board", board(t, 7.0)))
        messages.append((t, "vehicle/sent", Sent(t, (0.0,) * 3, 9.8, 0.4, t % 50_000_000 == 0, "")))
        if t % 20_000_000 == 0:
            seen = t <= CONTACT - 500_000_000
            messages.append((t + 30_000_000, "board/detection", detection(t, seen)))
        judged = verdict is not None and t >= CONTACT
        messages.append((t, "referee/contact", verdict if judged else contact(t, "ongoing", "", False, False)))
    return sorted(messages, key=lambda m: m[0])


def test_flight_by_motion_capture_has_no_perception_rates():
    messages = [m for m in flight(contact(CONTACT)) if m[1] != "board/detection"]
    by_mocap = score_messages(load("crazyflie-wall"), 0, messages, camera=False).metrics
    assert (by_mocap.perception_desired_hz, by_mocap.perception_actual_hz, by_mocap.perception_found_hz) == (None,) * 3
    blind = score_messages(load("hard-i"), 0, messages).metrics
    assert (blind.perception_desired_hz, blind.perception_actual_hz, blind.perception_found_hz) == (60.0, None, 0.0)


def test_score_has_the_columns_of_the_published_row():
    score = score_messages(load("hard-i"), 7, flight(contact(CONTACT)))
    m = score.metrics
    assert (score.scenario, score.seed, score.outcome, score.reasons) == ("hard-i", 7, "success", ())
    assert score.attached
    assert score.within_tolerance
    assert m.platform_speed == pytest.approx((1.0, 2.5), abs=0.01)
    assert m.inclination_deg == 70.0
    assert m.inclination_measured_deg == pytest.approx(70.0)
    assert (m.x, m.y, m.planar) == pytest.approx((0.03, -0.04, 0.05))
    assert m.normal_alignment_deg == pytest.approx(5.0)
    assert (m.impact_normal, m.impact_tangential) == (-0.5, 0.2)
    assert (m.perception_desired_hz, m.perception_actual_hz) == (60.0, pytest.approx(50.0))
    assert m.perception_found_hz == pytest.approx(126 / 3)
    assert m.duration == pytest.approx(3.0)
    assert m.blind_time == pytest.approx(0.5)
    assert m.detection_latency == pytest.approx(0.03)
    assert m.commands == 301  # both ends included
    assert m.commands_limited == 61


def test_score_uses_only_the_attempt():
    score = score_messages(load("hard-i"), 0, flight(contact(CONTACT)))
    assert score.metrics.platform_speed[1] < 9.0  # before the attempt
    assert score.metrics.platform_speed[0] > 0.0  # after the contact


def test_attached_and_within_tolerance_are_scored_separately():
    score = score_messages(load("hard-i"), 0, flight(contact(CONTACT, "fail", "distance", True, False)))
    assert (score.attached, score.within_tolerance, score.reasons) == (True, False, ("distance",))
    assert score.metrics.planar is not None


def test_vehicle_that_fell_after_contact_is_not_attached():
    fell = CONTACT + 80_000_000, "event", Event(CONTACT, "error", "vehicle_link", NOT_HELD)
    score = score_messages(load("hard-i"), 0, [*flight(contact(CONTACT)), fell])
    assert (score.attached, score.within_tolerance, score.verdict) == (False, True, "missed")
    assert NOT_HELD in score.reasons


@pytest.mark.parametrize("reason", ["ground", "workspace", "time", "not_finite"])
def test_without_contact_there_are_no_terminal_errors(reason):
    score = score_messages(load("hard-i"), 0, flight(contact(CONTACT, "fail", reason, False, False)))
    m = score.metrics
    assert (m.x, m.y, m.planar, m.normal_alignment_deg, m.impact_normal, m.impact_tangential) == (None,) * 6
    assert m.duration == pytest.approx(3.0)
    assert score.reasons == (reason,)


def test_rarely_detected_board_is_a_reason_of_the_score():
    messages = [m for m in flight(contact(CONTACT, "fail", "time", False, False)) if m[1] != "board/detection"]
    stamps = range(START, CONTACT, 100_000_000)
    looks = [(t, "board/detection", detection(t, k == 3, "" if k == 3 else "ambiguous")) for k, t in enumerate(stamps)]
    score = score_messages(load("hard-i"), 0, sorted([*messages, *looks], key=lambda m: m[0]))
    assert score.reasons == ("time", f"the board was found in 1 of {len(looks)} pictures; mostly: ambiguous")


def test_score_keeps_the_first_verdict():
    messages = flight(contact(CONTACT))
    messages.append((6_000_000_000, "referee/contact", contact(6_000_000_000, "fail", "distance", False, False)))
    assert score_messages(load("hard-i"), 0, messages).within_tolerance


def test_truncated_run_is_scored_as_incomplete_with_a_reason():
    score = score_messages(load("hard-i"), 0, flight(None))
    assert score.outcome == "incomplete"
    assert "before the referee decided" in score.reasons[0]
    assert not score.attached
    assert score.metrics.duration == pytest.approx(3.99)


def test_score_of_an_empty_run_has_no_metrics():
    score = score_messages(load("hard-i"), 0, [])
    m = score.metrics
    assert (m.platform_speed, m.duration, m.perception_actual_hz, m.blind_time, m.detection_latency) == (None,) * 5


def test_score_uses_motion_capture_without_truth():
    messages = [m for m in flight(contact(CONTACT)) if m[1] != "truth/board"]
    assert score_messages(load("hard-i"), 0, messages).metrics.platform_speed == (7.0, 7.0)


def test_tripped_gate_is_a_reason_of_the_score():
    scorer = Scorer(load("hard-i"), 0)
    for message in flight(None):
        scorer(*message)
    scorer(6_000_000_000, "vehicle/sent", Sent(6_000_000_000, (0.0,) * 3, 0.0, 0.0, True, "stale action"))
    assert "gate: stale action" in scorer.result().reasons


def test_the_score_is_json_without_nan():
    score = score_messages(load("hard-i"), 0, flight(contact(CONTACT)))
    assert json.loads(json.dumps(score.as_dict(), allow_nan=False))["metrics"]["planar"] == pytest.approx(0.05)


def aborted(at, source="supervisor", text=f"{ABORTED}brain was killed by SIGKILL"):
    return at, "event", Event(at, "warning", source, text)


def test_what_follows_an_abort_is_no_verdict():
    """The vehicle is handed back and lands: the referee sees it on the ground."""
    messages = sorted(
        [*flight(contact(CONTACT, "fail", "ground", False, False)), aborted(4_000_000_000)], key=lambda m: m[0]
    )
    score = score_messages(load("hard-i"), 0, messages)
    assert (score.outcome, score.verdict) == ("incomplete", "incomplete")
    assert score.reasons == ("aborted: brain was killed by SIGKILL",)
    assert (score.attached, score.within_tolerance, score.metrics.planar) == (False, False, None)
    assert score.metrics.duration == pytest.approx(2.0, abs=0.02), "up to the abort"


def test_abort_after_the_contact_keeps_its_numbers_but_is_no_verdict():
    messages = [*flight(contact(CONTACT)), aborted(CONTACT + 300_000_000)]
    score = score_messages(load("hard-i"), 0, sorted(messages, key=lambda m: m[0]))
    assert (score.verdict, score.attached) == ("incomplete", True)
    assert score.metrics.planar == pytest.approx(0.05)


def test_abort_that_is_not_in_the_recording_is_told_by_the_caller():
    score = score_messages(load("hard-i"), 0, flight(contact(CONTACT)), "interrupted")
    assert (score.verdict, score.reasons) == ("incomplete", ("aborted: interrupted",))


@pytest.mark.parametrize("event", [{"source": "brain"}, {"text": "the date was set back"}], ids=str)
def test_other_events_end_no_attempt(event):
    messages = sorted([*flight(contact(CONTACT)), aborted(4_000_000_000, **event)], key=lambda m: m[0])
    assert score_messages(load("hard-i"), 0, messages).verdict == "perched"


@pytest.mark.parametrize("state", ["running", "interrupted", "failed", "refused", ""])
def test_only_a_finished_run_is_a_verdict(state):
    found = {"attached": True, "within_tolerance": True, "outcome": "success"}
    assert verdict_word(**found, state=state) == "incomplete"
    assert verdict_word(**found, state="finished") == "perched"
