"""One broken message at every topic in turn, into belief, policy and gate: the flight ends safe or flies on sound data.

A hovering vehicle follows a board that is detected every 30 ms. In the middle one number of one message is broken: NaN,
infinite, huge, a stamp of the future or of the past. Then all is sound again. Whatever happens, nothing that is not
finite is sent. Either the gate has tripped, and nothing more is sent; or what is sent is what an undisturbed twin
sends, but for the message that it lacks.
PERCH_HIL_ATTACK multiplies the number of cases; beyond 1 all policies are flown, not one of each kind.
"""

import math
import os
import random
import time
from dataclasses import fields, replace

import pytest

from hil.assembly.builder import Assembly
from hil.assembly.rig import load_rig
from hil.contract.messages import BoardState, CarCommand, CarFeedback, Contact, Detection, Stage, VehicleState
from hil.contract.node import Inbox
from hil.nodes.belief import BeliefNode
from hil.nodes.policy import PolicyNode
from hil.nodes.vehicle import VehicleLink
from hil.safety.car_gate import CarGate
from hil.safety.limits import CarGateLimits, GateLimits
from hil.safety.vehicle_gate import VehicleGate
from kernel.rotations import from_euler
from policies.estimation.board_filter import BoardFilter
from policies.flying.registry import policy_factory
from policies.flying.shipped import FLYABLE
from scenarios.draw import draw
from scenarios.spec import load
from tests.unit.policies.flying.made_networks import made_for
from vehicle.px4.driver.clocks import ClockOffset
from vehicle.px4.driver.types import LinkOutput, Odometry
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
FACTOR = max(1, round(float(os.environ.get("PERCH_HIL_ATTACK", "1"))))
AIRFRAME = load_airframe("paper_quad")
LEVEL, STILL = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
BEFORE, AFTER = 16, 12  # ticks of 10 ms
NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -1e300)
STAMPS_MS = (6, 60, 3_600_000, 2**63 // MS, -60, -3_600_000, -(2**63) // MS)  # from now


class Link:
    """The driver of a vehicle that hovers; it notes what is sent."""

    phase, armed, garbage, parameters = "handed_over", True, 0, {}

    def release(self):
        """The gate hands back."""

    def __init__(self, spoil):
        self.spoil, self.sent, self.poses, self.told_ns = spoil, [], [], -1

    def step(self, now_ns, command=None, external_pose=None):
        output = LinkOutput("handed_over", True, True, False, False, "OFFBOARD", 15.0, 0.5)
        if now_ns > self.told_ns:
            self.told_ns = now_ns
            seen = self.spoil("autopilot", VehicleState(now_ns, (0.0, 0.0, 2.5), (0.3, 0.0, 0.0), LEVEL, STILL))
            output.odometry = [Odometry(*(getattr(seen, one.name) for one in fields(seen)))]
        if command is not None:
            self.sent.append((now_ns, command))
            output.sent_thrust = 0.5
        if external_pose is not None:
            self.poses.append(external_pose)
        return output


def detection(exposure_ns):
    place = (2.0 + exposure_ns * 1e-9, 0.1, 1.5)
    return Detection(exposure_ns, True, place, from_euler(0.0, -0.9, 0.1), 0.01, 0.01, (0,), (), "", 0, 0)


class Flight:
    """Belief, policy, and driver with gate, stepped by hand; `spoil(topic, message)` may change one message."""

    def __init__(self, policy, spoil=lambda topic, message: message):
        policy.reset(0)
        self.link = Link(spoil)
        self.gate = VehicleGate(GateLimits())
        self.nodes = [
            VehicleLink(self.link, self.gate, external_pose=True), BeliefNode(BoardFilter()), PolicyNode(policy),
        ]  # fmt: skip
        self.inboxes = [Inbox(node.inputs) for node in self.nodes]
        self.spoil, self.now, self.beliefs, self.events = spoil, 0, [], []

    def give(self, topic, message):
        """To all readers, each of which steps when it is woken."""
        message = self.spoil(topic, message)
        for node, inbox in zip(self.nodes, self.inboxes, strict=True):
            if topic in node.inputs:
                inbox.put(topic, message)
                if topic in node.wakes:
                    self.step(node, inbox)

    def step(self, node, inbox):
        outs = node.step(self.now, inbox)
        inbox.clear()
        for out in outs:
            if out.topic == "belief":
                self.beliefs.append(out.message)
            if out.topic == "event":
                self.events.append(out.message.text)
            self.give(out.topic, out.message)

    def tick(self, k):
        self.now = 10 * k * MS
        self.give("run/stage", Stage(self.now, "attempt", 1, 1))
        measured = (1e-6 * (self.now // MS % 97), 0.0, 2.5)  # never the same twice
        self.give("mocap/vehicle", VehicleState(self.now - 5 * MS, measured, STILL, LEVEL, STILL))
        self.give("referee/contact", Contact(self.now, "ongoing", "", False, False, 0.0, 0.0, 0.0, 0.0, 0.0))
        if k % 3 == 0:
            self.give("board/detection", detection(self.now - 50 * MS))
        self.step(self.nodes[0], self.inboxes[0])


def places(topic, message):
    """Every number and stamp of a message: (topic, field, index or None)."""
    for one in fields(message):
        value = getattr(message, one.name)
        if one.name in ("stamp_ns", "exposure_ns", "last_exposure_ns") or isinstance(value, float):
            yield topic, one.name, None
        elif isinstance(value, tuple) and value and isinstance(value[0], float):
            yield from ((topic, one.name, index) for index in range(len(value)))


def broken(message, field, index, value, now_ns):
    if field.endswith("_ns"):
        return replace(message, **{field: now_ns + round(value * MS)})
    if index is None:
        return replace(message, **{field: value})
    numbers = list(getattr(message, field))
    numbers[index] = value
    return replace(message, **{field: tuple(numbers)})


@pytest.fixture(scope="module", params=FLYABLE if FACTOR > 1 else ("state", "planner"))
def policy(request):
    return policy_factory(request.param, made_for(request.param))()


@pytest.fixture(scope="module")
def twin(policy):
    """(the undisturbed flight, the places of its messages)."""
    found = {}

    def look(topic, message):
        if topic not in ("event", "run/stage", "vehicle/status", "vehicle/sent"):
            found.setdefault(topic, list(places(topic, message)))
        return message

    flight = Flight(policy, look)
    for k in range(BEFORE + AFTER):
        flight.tick(k)
    assert flight.beliefs[-1].valid and not flight.gate.tripped
    assert len(flight.link.sent) > AFTER
    return flight, [place for topic in sorted(found) for place in found[topic]]


def attack(policy, place, value):
    """A flight in which one message is broken, once."""
    topic, field, index = place
    done = []

    def spoil(name, message):
        if name != topic or done or flight.now < 10 * BEFORE * MS:
            return message
        done.append(True)
        return broken(message, field, index, value, flight.now)

    flight = Flight(policy, spoil)
    for k in range(BEFORE + AFTER):
        flight.tick(k)
    assert done
    return flight


def check_sound(flight, undisturbed, what):
    for _, command in flight.link.sent:
        assert all(map(math.isfinite, (*command.body_rate, command.thrust))), what
    assert all(all(map(math.isfinite, pose.position + pose.orientation)) for pose in flight.link.poses), what
    assert all(pose.stamp_ns <= 10 * (BEFORE + AFTER) * MS for pose in flight.link.poses), what
    mine, its = dict(flight.link.sent), dict(undisturbed.link.sent)
    for now, command in mine.items():
        assert command.thrust == pytest.approx(its[now].thrust, abs=2.0), what
        assert command.body_rate == pytest.approx(its[now].body_rate, abs=0.7), what
    assert bool(flight.gate.tripped) or len(mine) >= len(its) - 1, what


def test_one_broken_message_at_every_topic_ends_the_flight_safe_or_changes_nothing(policy, twin):
    undisturbed, everywhere = twin
    draws = random.Random(39)
    for place in everywhere:
        numbers = NUMBERS[:3] if place[0] == "policy/action" else NUMBERS  # a large command is clipped, by contract
        values = STAMPS_MS if place[1].endswith("_ns") else numbers
        for value in draws.sample(values, min(FACTOR, len(values))):
            flight = attack(policy, place, value)
            check_sound(flight, undisturbed, (place, value, flight.gate.tripped))


@pytest.mark.parametrize("ahead_ms", STAMPS_MS[:4])
def test_one_detection_of_the_future_does_not_blind_the_filter(policy, twin, ahead_ms):
    flight = attack(policy, ("board/detection", "stamp_ns", None), ahead_ms)
    last, its = flight.beliefs[-1], twin[0].beliefs[-1]
    assert (last.valid, last.rejected) == (True, 1)
    assert last.accepted == its.accepted - 1
    assert last.last_exposure_ns == its.last_exposure_ns
    assert ["later than now" in text for text in flight.events] == [True], flight.events


def test_without_detections_after_one_of_the_future_the_gate_trips_as_blind(policy):
    flight = Flight(policy)
    for k in range(BEFORE):
        flight.tick(k)
    real, flight.spoil = flight.give, lambda topic, message: message
    flight.give = lambda topic, message: real(topic, message) if topic != "board/detection" else None
    real("board/detection", detection(flight.now + 3_600_000 * MS))
    for k in range(BEFORE, BEFORE + 330):
        flight.tick(k)
    assert flight.gate.tripped.startswith("board not seen for 3.0 s")
    assert flight.beliefs[-1].rho < 0.01


def test_span_of_centuries_takes_the_filter_no_time():
    board = BoardFilter()
    for k in range(5):
        board.update(k * 30 * MS, (2.0, 0.0, 1.5), from_euler(0.0, -0.9, 0.1), 0.01, 0.01)
    board.estimate(150 * MS)
    began = time.perf_counter()
    for now_ns in (2**62, 2**63, -(2**63)):
        assert not board.estimate(now_ns).valid
    assert time.perf_counter() - began < 1.0


def test_car_is_never_driven_by_a_broken_measurement():
    """Whatever motion capture and the car's feedback say: what is sent to the car is finite and of a sound period."""
    scenario, rig = load("hard-i"), load_rig("sim")
    follower = Assembly(scenario, rig, draw(scenario, 0), lambda: None, None).node("car_follower")
    draws, gate, sent = random.Random(39), CarGate(CarGateLimits()), 0
    sound = BoardState(0, (0.0, 0.0, 1.5), STILL, LEVEL, 0.0, 0.0, 0.0)
    for k in range(200 * FACTOR):
        now = (1000 + 20 * k) * MS
        message = replace(sound, stamp_ns=now - 5 * MS)
        if k % 2:
            _, field, index = draws.choice(list(places("mocap/board", message)))
            message = broken(message, field, index, draws.choice(STAMPS_MS if field == "stamp_ns" else NUMBERS), now)
        inbox = Inbox(follower.inputs)
        inbox.put("mocap/board", message)
        inbox.put("run/stage", Stage(now, "lead", 1, 1))
        for out in follower.step(now, inbox):
            if isinstance(out.message, CarCommand):
                checked = gate.check(now, out.message, CarFeedback(now, 0.0, 0.0, "can", 26.0, "", 0))
                assert checked is not None and math.isfinite(checked.speed + checked.turn_rate)
                sent += 1
    assert not gate.tripped
    assert sent >= 100 * FACTOR


def test_broken_time_synchronisation_moves_no_stamp():
    draws, clock = random.Random(39), ClockOffset()
    for k in range(300 * FACTOR):
        now = 100 * k * MS
        if k > 3 and k % 3 == 0:
            off = draws.choice((1, -1)) * draws.randrange(3_600_000 * MS, 2**62)
            clock.add(now, now + MS + off, now + 2 * MS)
        else:
            clock.add(now, now + MS, now + 2 * MS)
        assert clock.ours(now) == now
