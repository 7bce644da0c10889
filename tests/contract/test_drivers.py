"""Every vehicle's driver on its own software vehicle: the same few methods, phases and promises."""

import math

import pytest

from hil.contract.wire import memory_pair
from vehicle.crazyflie.driver.driver import CrazyflieLink
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import ExternalPose, LinkConfig, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

MS = 1_000_000
START = (0.6, 0.4, 1.8, 0.3)
HOVER = Rates((0.0, 0.0, 0.0), GRAVITY)


def px4(ours, theirs, arm):
    frame = load_airframe("paper_quad")
    return Px4Link(ours, LinkConfig(START, hover_thrust=frame.hover_thrust, arm=arm)), Px4Sim({"api": theirs}, frame, 1)


def crazyflie(ours, theirs, arm):
    frame = load_airframe("crazyflie")
    return CrazyflieLink(ours, CrazyflieConfig(START, frame.body.mass, arm=arm)), CrazyflieSim(theirs, frame, 1)


class Flight:
    """A driver and its vehicle, with motion capture."""

    def __init__(self, vehicle, arm=True):
        self.now = 0
        ours, theirs = memory_pair(lambda: self.now, MS)
        self.link, self.sim = vehicle(ours, theirs, arm)
        self.notes, self.odometry, self.output = [], [], None

    def run(self, ms, command=None):
        end = self.now + ms * MS
        while self.now < end:
            self.now += 2 * MS
            self.sim.step(self.now)
            at, truth = self.now // MS, self.sim.truth()
            pose = ExternalPose(self.now, truth.position, truth.orientation) if at % 10 == 0 else None
            self.output = self.link.step(self.now, command if at % 10 == 0 else None, pose)
            self.notes += self.output.notes
            self.odometry += [(self.now, sample, truth) for sample in self.output.odometry]

    def until(self, *phases):
        while self.link.phase not in phases and self.now < 60_000 * MS:
            self.run(20)
        assert self.link.phase in phases, self.notes
        return self


@pytest.fixture(params=[px4, crazyflie], ids=lambda vehicle: vehicle.__name__)
def vehicle(request):
    return request.param


def test_driver_takes_it_to_the_start_flies_its_rates_with_odometry_on_our_clock_and_lands_it(vehicle):
    flight = Flight(vehicle).until("hover")
    assert math.dist(flight.sim.truth().position, START[:3]) < 0.2
    flight.odometry.clear()
    flight.run(300, HOVER)
    assert flight.link.phase == "handed_over"
    for axis in range(3):
        rate = [0.0, 0.0, 0.0]
        rate[axis] = 0.5
        flight.run(250, Rates(tuple(rate), GRAVITY))
        assert flight.sim.truth().body_rate[axis] == pytest.approx(0.5, abs=0.2)
        flight.run(250, Rates(tuple(-r for r in rate), GRAVITY))
    assert len(flight.odometry) >= 90 * 1.8
    for now, sample, truth in flight.odometry:
        assert 0 <= now - sample.stamp_ns < 20 * MS
        assert math.dist(sample.position, truth.position) < 0.1
        assert math.dist(sample.velocity, truth.velocity) < 0.25
        assert abs(sum(a * b for a, b in zip(sample.orientation, truth.orientation, strict=True))) > 0.998
    flight.link.release()
    flight.run(15000)
    assert flight.link.phase == "released"
    assert not flight.link.armed
    assert flight.sim.truth().position[2] == pytest.approx(0.0, abs=0.05)


def test_control_is_not_resumed_after_commands_have_stopped(vehicle):
    flight = Flight(vehicle).until("hover")
    flight.run(300, HOVER)
    flight.run(500)
    assert flight.link.phase == "released"
    assert any("control lost: no command for 0.25 s" in note.text for note in flight.notes)
    refused = flight.link.refused
    flight.run(100, HOVER)
    assert flight.link.refused > refused
    assert flight.output.sent_thrust is None


def test_command_that_is_not_finite_is_not_sent_and_kill_stops_the_motors_in_the_air(vehicle):
    flight = Flight(vehicle).until("hover")
    for command in (Rates((math.nan, 0.0, 0.0), 9.8), Rates((0.0, 0.0, 0.0), math.inf)):
        flight.run(20, command)
    assert flight.link.refused >= 4
    assert flight.link.phase == "hover"
    flight.run(200, HOVER)
    flight.link.kill()
    flight.run(500)
    assert flight.link.phase == "killed"
    assert not flight.link.armed
    assert max(flight.sim.truth().motors) < 0.05


def test_it_is_armed_only_with_permission_and_as_it_was_checked(vehicle):
    flight = Flight(vehicle, arm=False).until("ready")
    flight.run(2000)
    assert flight.link.phase == "ready"
    assert not flight.link.armed
    name, value = next(iter(flight.link.parameters.items()))
    flight.link.allow_arming(Arming(parameters={name: value + 1.0}))
    flight.until("failed")
    assert "not armed, this is not as it was checked" in flight.notes[-1].text
    assert not flight.link.armed


def test_refused_it_stays_on_the_ground_and_release_has_no_effect(vehicle):
    flight = Flight(vehicle, arm=False).until("ready")
    flight.link.refuse_arming()
    flight.link.release()
    flight.run(1000)
    assert flight.link.phase == "failed"
    assert not flight.link.armed
