import math

import pytest

from hil.contract.messages import BoardState, Detection, VehicleState
from hil.nodes.belief import BeliefNode, MocapBeliefNode
from kernel.rotations import from_euler
from policies.estimation.board_filter import BoardFilter
from tests.unit.hil.contract.node_fakes import filled

MS = 1_000_000
SPEED, HEADING, TILT = 1.5, 0.3, math.radians(50.0)


def detection(stamp, found=True):
    along = SPEED * stamp * 1e-9
    position = (along * math.cos(HEADING), along * math.sin(HEADING), 1.5)
    return Detection(stamp, found, position, from_euler(0.0, -TILT, HEADING), 0.01, 0.01, (0,), (), "", 0, 0)


def odometry(stamp):
    return VehicleState(stamp, (0.0, 0.0, 2.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)


def step(node, now_ns, *detections, tick=True):
    messages = [("board/detection", seen) for seen in detections]
    if tick:
        messages.append(("vehicle/odometry", odometry(now_ns)))
    return [out.message for out in node.step(now_ns, filled(node, *messages))]


def test_a_belief_is_published_at_each_odometry_and_each_detection():
    node = BeliefNode(BoardFilter())
    assert set(node.wakes) == set(node.inputs)
    assert step(node, 0, detection(0), tick=False) == []  # no odometry yet
    (belief,) = step(node, 10 * MS)
    assert (belief.stamp_ns, belief.accepted) == (10 * MS, 1)
    inbox = filled(node, ("vehicle/odometry", odometry(20 * MS)))
    node.step(20 * MS, inbox)
    inbox.clear()
    inbox.put("board/detection", detection(15 * MS))
    (out,) = node.step(26 * MS, inbox)
    assert (out.message.stamp_ns, out.message.last_exposure_ns) == (26 * MS, 15 * MS)
    inbox.clear()
    inbox.put("board/detection", detection(30 * MS, found=False))
    assert node.step(41 * MS, inbox) == []


def test_the_belief_is_predicted_to_now():
    node, late = BeliefNode(BoardFilter()), 60 * MS
    for frame in range(60):
        exposure = frame * 33 * MS
        (belief,) = step(node, exposure + late, detection(exposure))
    now_s = belief.stamp_ns * 1e-9
    assert belief.valid
    assert belief.last_exposure_ns == belief.stamp_ns - late
    assert belief.position[0] == pytest.approx(SPEED * now_s * math.cos(HEADING), abs=0.02)
    assert belief.position[1] == pytest.approx(SPEED * now_s * math.sin(HEADING), abs=0.02)
    assert (belief.speed, belief.heading, belief.inclination) == pytest.approx((SPEED, HEADING, TILT), abs=0.05)


def test_picture_without_the_board_does_not_change_the_belief():
    node = BeliefNode(BoardFilter())
    step(node, 0, detection(0))
    (belief,) = step(node, 10 * MS, detection(5 * MS, found=False))
    assert (belief.accepted, belief.rejected, belief.last_exposure_ns) == (1, 0, 0)


def test_a_detection_that_is_not_finite_is_counted_and_the_belief_stays_finite():
    node = BeliefNode(BoardFilter())
    for frame in range(30):
        (before,) = step(node, frame * 33 * MS, detection(frame * 33 * MS))
    poisoned = Detection(1_000 * MS, True, (math.nan, 0.0, 1.5), (1.0, 0.0, 0.0, 0.0), 0.01, 0.01, (), (), "", 0, 0)
    (after,) = step(node, 1_000 * MS, poisoned)
    assert after.rejected == before.rejected + 1
    assert after.accepted == before.accepted
    assert all(map(math.isfinite, (*after.position, after.heading, after.speed, after.rho, *after.variance)))


def test_detection_stamped_later_than_now_is_reported_once_and_later_ones_are_used():
    node = BeliefNode(BoardFilter())
    for frame in range(10):
        (belief,) = step(node, (frame * 33 + 60) * MS, detection(frame * 33 * MS))
    late = 3_600_000 * MS
    event, after = step(node, 370 * MS, detection(late))
    assert (event.severity, "later than now" in event.text) == ("warning", True)
    assert (after.accepted, after.rejected, after.valid) == (belief.accepted, 1, True)
    (again,) = step(node, 380 * MS, detection(late + MS))
    assert again.rejected == 2
    (used,) = step(node, 390 * MS, detection(330 * MS))
    assert used.accepted == belief.accepted + 1
    assert node.counters["detections refused, stamped later than now"] == 2


def captured(stamp):
    """Motion capture's board, which claims to stand still."""
    seen = detection(stamp)
    return BoardState(stamp, seen.position, (0.0,) * 3, seen.orientation, HEADING, 0.0, 0.0)


def test_motion_capture_gives_speed_from_poses_alone_and_its_delay_is_predicted_over():
    node = MocapBeliefNode(BoardFilter())
    assert set(node.wakes) == set(node.inputs)
    delay = 30 * MS
    for at in range(0, 1500 * MS, 10 * MS):
        now = at + delay
        messages = [("mocap/board", captured(at)), ("vehicle/odometry", odometry(now))]
        belief = [out.message for out in node.step(now, filled(node, *messages))][-1]
    assert belief.valid
    assert belief.speed == pytest.approx(SPEED, abs=0.02)
    assert belief.turn_rate == pytest.approx(0.0, abs=0.05)
    along = SPEED * belief.stamp_ns * 1e-9
    assert belief.position[0] == pytest.approx(along * math.cos(HEADING), abs=0.01)
    assert belief.last_exposure_ns == belief.stamp_ns - delay


def test_motion_capture_stamped_later_than_now_is_refused_and_told():
    node = MocapBeliefNode(BoardFilter())
    outs = node.step(0, filled(node, ("mocap/board", captured(100 * MS))))
    assert [out.message.text for out in outs] == [
        "a pose of motion capture was refused: stamped later than now; further ones are only counted"
    ]
    assert node.counters == {"poses of motion capture refused, stamped later than now": 1}
