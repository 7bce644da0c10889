import math
from dataclasses import replace

import pytest

from hil.contract.messages import BoardState, Stage, VehicleState
from hil.nodes.referee import Referee
from kernel.rotations import from_euler
from policies.task.contact import ContactRules
from tests.unit.hil.contract.node_fakes import filled
from vehicle.quadrotor.airframe import load_airframe

START = 10_000_000_000
RULES = ContactRules()
DISC = load_airframe("paper_quad").contact
TILT = math.radians(60.0)


def stage(name="attempt"):
    return Stage(START, name, START, START - 1)


def board(incl=TILT, speed=0.0):
    return BoardState(START, (0.0, 0.0, 1.5), (speed, 0.0, 0.0), from_euler(0.0, -incl, 0.0), 0.0, speed, 0.0)


def vehicle(gap=0.3, closing=0.5, along=0.0, tilt=TILT, offset=0.0, board_speed=0.0):
    """Above the board of inclination TILT: its pads `gap` from the surface, closing along the normal (m, m/s)."""
    normal = (-math.sin(TILT), 0.0, math.cos(TILT))
    slope = (math.cos(TILT), 0.0, math.sin(TILT))
    height = DISC.magnet_below + gap
    position = tuple(c + height * n + offset * s for c, n, s in zip((0.0, 0.0, 1.5), normal, slope, strict=True))
    velocity = [along * s - closing * n for n, s in zip(normal, slope, strict=True)]
    velocity[0] += board_speed
    return VehicleState(START, position, tuple(velocity), from_euler(0.0, -tilt, 0.0), (0.0, 0.0, 0.0))


def judge(referee, now_ns, vehicle_state, name="attempt", board_state=None, late_ns=0):
    """What it publishes at `now_ns`; `late_ns` is how much later than START the samples are."""
    seen, below = (replace(one, stamp_ns=one.stamp_ns + late_ns) for one in (vehicle_state, board_state or board()))
    inbox = filled(referee, ("mocap/vehicle", seen), ("mocap/board", below), ("run/stage", stage(name)))
    return [out.message for out in referee.step(now_ns, inbox)]


def test_referee_publishes_nothing_outside_the_attempt():
    referee = Referee(RULES, DISC, TILT)
    for name in ("prepare", "lead", "ended"):
        assert judge(referee, START, vehicle(gap=-0.01), name) == []
    assert referee.step(START, filled(referee, ("run/stage", stage()))) == [], "nor before it has seen anything"


@pytest.mark.parametrize("frozen", ["vehicle", "board"])
def test_no_contact_is_judged_by_a_pose_that_repeats(frozen):
    """A hidden board whose last pose is sent on is not where the vehicle meets it."""
    referee, judged = Referee(RULES, DISC, TILT), []
    for k in range(60):
        away, shift = vehicle(gap=0.3), (1e-6 * (k % 7), 0.0, 0.0)
        bodies = {"vehicle": away, "board": board()}
        for name, one in bodies.items():
            moved = tuple(a + b for a, b in zip(one.position, shift, strict=True))
            bodies[name] = one if name == frozen and k >= 10 else replace(one, position=moved)
        now = START + k * 10_000_000
        judged.append(bool(judge(referee, now, bodies["vehicle"], board_state=bodies["board"], late_ns=now - START)))
    assert judged == [k < 30 for k in range(60)], "0.2 s after it has come for the first time"


def test_contact_within_all_tolerances_is_a_success():
    referee = Referee(RULES, DISC, TILT)
    (seen,) = judge(referee, START, vehicle(gap=0.3))
    assert (seen.outcome, seen.attached) == ("ongoing", False)
    contact, event = judge(referee, START + 10_000_000, vehicle(gap=-0.001, along=0.2, offset=0.05))
    assert (contact.outcome, contact.reason, contact.attached, contact.within_tolerance) == ("success", "", True, True)
    assert contact.stamp_ns == START, "the time of the sample, not of the judgement"
    assert contact.x == pytest.approx(0.05, abs=1e-6)
    assert contact.normal_speed == pytest.approx(-0.5)
    assert contact.tangential_speed == pytest.approx(0.2)
    assert contact.normal_error == pytest.approx(0.0, abs=1e-6)
    assert event.text == "success, attached"


def test_speeds_are_relative_to_a_moving_board():
    referee = Referee(RULES, DISC, TILT)
    contact, _ = judge(referee, START, vehicle(gap=-0.001, board_speed=2.0), board_state=board(speed=2.0))
    assert contact.within_tolerance
    assert (contact.normal_speed, contact.tangential_speed) == pytest.approx((-0.5, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("state", "reason", "attached"),
    [
        (vehicle(gap=-0.001, along=0.9), "tangential_speed", False),
        (vehicle(gap=-0.001, offset=0.21), "distance", False),
        (vehicle(gap=-0.001, tilt=TILT - 0.25), "alignment", True),
    ],
)
def test_violated_tolerance_is_named_and_attachment_judged_separately(state, reason, attached):
    contact, event = judge(Referee(RULES, DISC, TILT), START, state)
    assert (contact.outcome, contact.reason, contact.within_tolerance) == ("fail", reason, False)
    assert contact.attached == attached
    assert reason in event.text


def after_the_limit(seconds, **about):
    """The outcome, reason, attachment of a vehicle that is `about` there so long after the time limit."""
    after = round((RULES.time_limit + seconds) * 1e9)
    contact, *_ = judge(Referee(RULES, DISC, TILT), START + after, vehicle(**about), late_ns=after)
    assert not contact.within_tolerance
    return contact.outcome, contact.reason, contact.attached


def test_approach_that_is_about_to_end_is_awaited_beyond_the_time_limit():
    assert after_the_limit(0.01, gap=1.4, closing=4.0) == ("ongoing", "", False)
    assert after_the_limit(1.4, gap=0.5, closing=1.0) == ("ongoing", "", False)


def test_contact_after_the_time_limit_has_failed_by_time_and_may_hold():
    assert after_the_limit(0.5, gap=-0.001, closing=1.0) == ("fail", "time", True)
    assert after_the_limit(0.5, gap=-0.001, closing=4.0) == ("fail", "time", False)


@pytest.mark.parametrize(
    ("seconds", "gap", "closing"), [(0.01, 4.2, 4.0), (1.6, 0.5, 1.0), (0.01, 0.5, 0.0), (0.01, 0.5, -1.0)]
)
def test_vehicle_that_does_not_arrive_fails_at_the_time_limit(seconds, gap, closing):
    assert after_the_limit(seconds, gap=gap, closing=closing) == ("fail", "time", False)


def test_attempt_fails_at_the_time_limit_and_on_the_ground():
    late = round(RULES.time_limit * 1e9) + 1_000_000
    contact, _ = judge(Referee(RULES, DISC, TILT), START + late, vehicle(gap=1.0), late_ns=late)
    assert (contact.outcome, contact.reason) == ("fail", "time")
    low = VehicleState(START, (3.0, 0.0, 0.1), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
    contact, _ = judge(Referee(RULES, DISC, TILT), START, low)
    assert (contact.outcome, contact.reason) == ("fail", "ground")


def test_referee_keeps_its_first_verdict():
    referee = Referee(RULES, DISC, TILT)
    first, _ = judge(referee, START, vehicle(gap=-0.001, along=0.9))
    (again,) = judge(referee, START + 10_000_000, vehicle(gap=-0.001))
    assert again is first
    assert not again.within_tolerance


HOUR = 3_600_000_000_000


@pytest.mark.parametrize(
    "shifts", [(0, -250_000_000), (-250_000_000, 0), (-250_000_000, -250_000_000), (0, HOUR), (-HOUR, 0), (HOUR, HOUR)]
)
def test_no_contact_is_judged_by_late_samples_or_by_those_of_the_future(shifts):
    referee, touching = Referee(RULES, DISC, TILT), vehicle(gap=-0.001)
    seen, below = (replace(one, stamp_ns=START + by) for one, by in zip((touching, board()), shifts, strict=True))
    assert judge(referee, START, seen, board_state=below) == []
    contact, _ = judge(referee, START, touching)
    assert contact.attached, "sound samples are judged again"


def test_tilting_board_is_judged_as_motion_capture_measures_it():
    rising = BoardState(START, (0.0, 0.0, 1.5), (0.0, 0.0, 0.3), from_euler(0.0, -TILT, 0.0), 0.0, 0.0, 0.0)
    state = vehicle(gap=-0.001)
    risen = VehicleState(
        START, state.position, (state.velocity[0], 0.0, state.velocity[2] + 0.3), state.orientation, (0.0,) * 3
    )
    contact, _ = judge(Referee(RULES, DISC, None), START, risen, board_state=rising)
    assert contact.within_tolerance and contact.normal_speed == pytest.approx(-0.5, abs=1e-6)
    assert judge(Referee(RULES, DISC, math.radians(20.0)), START, risen, board_state=rising)[0].outcome != "success"
