"""The car's nodes: what drives it, and the driver with its gate, against the software Scout where that matters."""

import math
from dataclasses import replace

import pytest

from groundcar.motion import board_row
from groundcar.scout.dead_reckoning import DeadReckoning
from groundcar.scout.driver import Command, ScoutLink
from groundcar.scout.follower import CarRef
from groundcar.scout.sim import ScoutSim
from hil.contract.messages import BoardState, CarCommand, CarFeedback, Stage, VehicleStatus
from hil.contract.wire import CanFrame, memory_pair
from hil.nodes.car import CONTROL_PERIOD_NS, CarFollower, CarLink
from hil.safety.car_gate import CarGate
from hil.safety.limits import CarGateLimits
from tests.unit.hil.contract.node_fakes import filled

MS = 1_000_000
S = 1_000 * MS


class Car:
    """The driver's node on the bus of a software Scout."""

    def __init__(self, **limits):
        self.now = 0
        ours, self.theirs = memory_pair(lambda: self.now, MS)
        self.sim = ScoutSim(self.theirs, seed=1)
        self.node = CarLink(ScoutLink(ours), CarGate(CarGateLimits(**limits)))
        self.events, self.sent, self.feedback = [], [], []
        self.alive = True

    def run(self, seconds, command=None):
        """`command` (now_ns) -> CarCommand or None, at 50 Hz."""
        end = self.now + round(seconds * S)
        while self.now < end:
            if self.alive:
                self.sim.step(self.now)
            if self.now % CONTROL_PERIOD_NS == 0:
                given = command(self.now) if command else None
                received = [("car/command", given)] if given else []
                for out in self.node.step(self.now, filled(self.node, *received)):
                    {"event": self.events, "car/sent": self.sent, "car/feedback": self.feedback}[out.topic].append(
                        out.message
                    )
            self.now += 4 * MS
        return self

    @property
    def texts(self):
        return [event.text for event in self.events]


def drive(speed, turn_rate=0.0):
    return lambda now: CarCommand(now, speed, turn_rate)


def test_car_node_publishes_the_command_that_was_sent():
    car = Car(speed=1.0).run(1.0, drive(0.0)).run(2.0, drive(2.0, 0.3))
    assert {(c.speed, c.turn_rate) for c in car.sent[-50:]} == {(1.0, 0.3)}
    assert car.feedback[-1].speed == pytest.approx(1.0, abs=0.15)
    car.sent.clear()
    car.run(1.0)
    assert car.sent == [], "no command, nothing sent"


def test_car_node_sends_nothing_after_a_trip():
    car = Car().run(1.0, drive(0.0)).run(1.5, drive(1.5))
    assert car.feedback[-1].speed > 1.0
    car.run(0.02, drive(math.nan))
    car.sent.clear()
    before = car.sim.board_row(0.0, 0.0)[board_row.X]
    car.run(2.0, drive(1.5))
    assert car.sent == []
    assert car.feedback[-1].speed == pytest.approx(0.0, abs=0.03), "the Scout's own 500 ms watchdog"
    assert car.sim.board_row(0.0, 0.0)[board_row.X] > before
    assert [text for text in car.texts if "tripped" in text] == ["gate tripped: command is not finite"]
    assert next(e for e in car.events if "tripped" in e.text).severity == "error"


def test_car_node_sends_nothing_after_feedback_was_lost_and_returned():
    car = Car().run(1.0, drive(0.0)).run(1.0, drive(0.5))
    car.alive = False
    car.run(0.8, drive(0.5))
    assert "gate tripped: no feedback of the car for 500 ms" in car.texts
    assert any("silent" in text for text in car.texts)
    car.alive = True
    car.sent.clear()
    car.run(1.0, drive(0.5))
    assert car.sent == []


def test_invalid_can_frames_are_counted_and_ignored():
    car = Car().run(1.0, drive(0.5))
    for frame in ((0x7AB, b"\x01"), (0x221, b"short"), (0x211, b""), (0x3FF, bytes(8))):
        car.theirs.send(CanFrame(*frame))
    car.run(1.0, drive(0.5))
    assert car.node.counters["frames rejected on the car's wire"] == 4
    assert car.feedback[-1].rejected_frames == 4
    assert car.feedback[-1].speed == pytest.approx(0.5, abs=0.1)


def test_v1_car_is_reported_once_and_never_driven():
    car = Car()
    car.theirs.send(CanFrame(0x151, bytes(8)))
    car.run(1.0, drive(0.5))
    assert len(car.events) == 1
    assert "0x151" in car.texts[0]
    assert "V1" in car.texts[0]
    assert (car.sent, car.node.safe) == ([], True)


def test_abort_commands_zero_speed_and_is_safe_when_the_car_stands():
    car = Car().run(1.0, drive(0.0)).run(1.5, drive(1.0))
    assert not car.node.safe
    car.node.abort("a service has died")
    car.run(1.5, drive(1.0))
    assert car.sent[-1].speed == 0.0
    assert car.node.safe


def test_simulated_sensors_use_the_wheel_odometry_of_a_real_car():
    assert "truth/board" not in Car().node.outputs
    car = Car()
    ours, car.theirs = memory_pair(lambda: car.now, MS)
    car.sim = ScoutSim(car.theirs, seed=1, pose=(1.0, 2.0, 0.5))
    node = CarLink(ScoutLink(ours), CarGate(CarGateLimits()), DeadReckoning((1.0, 2.0, 0.5), 1.5, 0.7))
    boards = []
    while car.now < 4 * S:
        car.sim.step(car.now)
        if car.now % CONTROL_PERIOD_NS == 0:
            received = ("car/command", CarCommand(car.now, 1.0, 0.2))
            boards += [out.message for out in node.step(car.now, filled(node, received)) if out.topic == "truth/board"]
        car.now += 4 * MS
    row = car.sim.board_row(1.5, 0.7)
    board = boards[-1]
    driven = math.dist((1.0, 2.0), board.position[:2])
    assert driven > 2.0
    assert math.dist(board.position, (row[board_row.X], row[board_row.Y], 1.5)) < 0.15 * driven, (
        "but for what the wheels skid"
    )
    assert board.heading == pytest.approx(row[board_row.HEADING], abs=0.25)
    assert board.speed == pytest.approx(1.0, abs=0.1)
    vx, vy, _ = board.velocity
    assert (math.hypot(vx, vy), math.atan2(vy, vx)) == pytest.approx((board.speed, board.heading))


# the follower


def board(now, speed=0.0):
    return "mocap/board", BoardState(now, (0.0, 0.0, 1.5), (speed, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0.0, speed, 0.0)


class FakeFollower:
    """Wants 2 m/s and a turn from the start on."""

    def start(self, now_ns):
        pass

    def step(self, now_ns, x, y, heading, speed, turn_rate, stamp_ns):
        return CarRef(now_ns, 0.0, 0.0, 0.0, 2.0, 0.5), Command(now_ns, 2.0, 0.5)


def commands(node, begin_ns, seconds, stage):
    found = []
    for now in range(begin_ns, begin_ns + round(seconds * S), CONTROL_PERIOD_NS):
        for out in node.step(now, filled(node, board(now, 2.0), ("run/stage", Stage(now, stage, S, S)))):
            if out.topic == "car/command":
                found.append(out.message)
    return found


def test_the_car_is_brought_to_rest_when_the_run_has_ended():
    node = CarFollower(FakeFollower())
    assert commands(node, S, 0.2, "attempt")[-1].speed == 2.0
    ending = commands(node, 2 * S, 2.0, "ended")
    speeds = [c.speed for c in ending]
    assert speeds == sorted(speeds, reverse=True)
    assert max(a - b for a, b in zip([2.0, *speeds], speeds, strict=False)) <= 1.5 * 0.02 + 1e-9, (
        "no harder than 1.5 m/s^2"
    )
    assert (speeds[-1], ending[-1].turn_rate) == (0.0, 0.0)
    assert [c.turn_rate / c.speed for c in ending if c.speed] == pytest.approx(
        [0.25] * sum(c.speed > 0 for c in ending)
    )
    assert [c.stamp_ns for c in ending] == list(range(2 * S, 4 * S, CONTROL_PERIOD_NS)), "it goes on asking for rest"


def test_follower_commands_zero_speed_when_the_run_ends_before_the_start():
    node = CarFollower(FakeFollower())
    (out,) = node.step(S, filled(node, ("run/stage", Stage(S, "ended", 0, 0))))
    assert (out.message.speed, out.message.turn_rate) == (0.0, 0.0)


def test_follower_ignores_a_non_finite_measurement():
    node = CarFollower(FakeFollower())
    bad = ("mocap/board", BoardState(S, (math.nan, 0.0, 0.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0))
    assert node.step(S, filled(node, bad, ("run/stage", Stage(S, "attempt", S, S)))) == []


@pytest.mark.parametrize(
    "changes",
    [{"stamp_ns": S + 6 * MS}, {"stamp_ns": 2**62}, {"stamp_ns": -MS}, {"speed": 1e300}, {"heading": math.inf}],
)
def test_follower_does_not_drive_by_a_measurement_that_cannot_be_used(changes):
    node = CarFollower(FakeFollower())
    topic, sound = board(S, 2.0)
    stage = ("run/stage", Stage(S, "attempt", S, S))
    assert node.step(S, filled(node, (topic, replace(sound, **changes)), stage)) == []
    assert node.counters["periods without a usable measurement of the car"] == 1
    assert len(node.step(S, filled(node, (topic, sound), stage))) == 2


class Followed:
    """A follower on a board that drives along x at 2 m/s, and that motion capture sees where it says."""

    def __init__(self):
        self.node, self.now, self.texts = CarFollower(FakeFollower()), S, []

    def driven(self, seconds, x=0.0, start_ns=S, frozen=False, wheels=2.0):
        """For each period whether the car was commanded; `x`: m, the error of motion capture."""
        found = []
        for _ in range(round(seconds * S / CONTROL_PERIOD_NS)):
            self.now += CONTROL_PERIOD_NS
            topic, seen = board(self.now - 5 * MS, 2.0)
            seen = replace(seen, position=(x if frozen else 2.0 * self.now * 1e-9 + x, 0.0, 1.5))
            stage = ("run/stage", Stage(self.now, "attempt", start_ns, start_ns))
            feedback = ("car/feedback", CarFeedback(self.now, wheels, 0.0, "can", 26.0, "", 0))
            outs = self.node.step(self.now, filled(self.node, (topic, seen), stage, feedback))
            found.append(any(out.topic == "car/command" for out in outs))
            self.texts += [out.message.text for out in outs if out.topic == "event"]
        return found


def test_follower_does_not_drive_by_a_pose_that_has_jumped_until_it_has_jumped_back():
    car = Followed()
    assert all(car.driven(0.5))
    assert not any(car.driven(3.0, x=1.0)), "a lasting jump is no motion of the car"
    assert all(car.driven(0.5))
    assert not any(car.driven(0.5, x=-0.6))
    assert len(car.texts) == 1 and "the board's pose has jumped by 1.04 m" in car.texts[0]
    assert car.node.counters["periods without a usable measurement of the car"] == 175


def test_follower_takes_another_place_of_the_board_before_the_car_sets_off():
    car = Followed()
    later = 10 * S
    assert all(car.driven(0.2, start_ns=0) + car.driven(0.2, x=4.0, start_ns=0) + car.driven(0.2, start_ns=later))
    assert car.texts == []


def test_follower_does_not_drive_by_a_pose_that_repeats_while_the_wheels_turn():
    car = Followed()
    assert all(car.driven(1.0, x=2.0, frozen=True, wheels=0.0)), "it has not set off yet"
    found = car.driven(1.0, x=2.0, frozen=True)
    assert found == [k < found.index(False) for k in range(50)]
    assert 9 <= found.index(False) <= 11, "0.2 s"
    assert car.texts == [
        "the board's pose does not change while the car's wheels turn: the car is not driven by it until it changes"
    ]


@pytest.mark.parametrize("phase", ["brake", "released", "interrupted", "failed"])
def test_the_car_is_brought_to_rest_when_the_vehicle_has_been_given_up(phase):
    node, speeds = CarFollower(FakeFollower()), []
    for k in range(150):
        now = S + k * CONTROL_PERIOD_NS
        status = VehicleStatus(
            now, True, True, False, False, "AUTO.LAND", phase if k >= 25 else "handed_over", 16.0, 0.4
        )
        stage = ("run/stage", Stage(now, "attempt", S, S))
        outs = node.step(now, filled(node, board(now, 2.0), stage, ("vehicle/status", status)))
        assert {out.topic for out in outs} == {"car/reference", "car/command"}, "the supervisor waits for both"
        speeds += [out.message.speed for out in outs if out.topic == "car/command"]
    assert speeds[:25] == [2.0] * 25
    assert speeds[25:] == pytest.approx([max(0.0, 2.0 - 0.03 * k) for k in range(1, 126)])
