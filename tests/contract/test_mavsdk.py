"""MAVSDK, a client from another project, flies the software PX4 over UDP in real time, as it flies a real one."""

import math
import socket
import threading
import time

import pytest

from hil.wires.udp import UdpWire
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

mavsdk = pytest.importorskip("mavsdk", reason="the package mavsdk is not installed")
actions = pytest.importorskip("mavsdk.plugins.action")
offboards = pytest.importorskip("mavsdk.plugins.offboard")
telemetries = pytest.importorskip("mavsdk.plugins.telemetry")
AttitudeRate, FlightMode = offboards.AttitudeRate, telemetries.FlightMode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]
LOCAL = "127.0.0.1"
BOOTED_NS = 5_200_000_000


class Autopilot(threading.Thread):
    """The software PX4 at the pace of the wall clock, booted in advance. Like PX4, it does not wait for a client."""

    def __init__(self, client_port, link="api"):
        super().__init__(daemon=True)
        self.wire = UdpWire((LOCAL, 0), (LOCAL, client_port), partner="first", accept_others=True)
        self.sim = Px4Sim({link: self.wire}, load_airframe("sih_quad"), 1)
        self.sim.step(0)
        self.sim.step(BOOTED_NS)
        self.failure = None
        self._ended = threading.Event()

    def run(self):
        try:
            start = time.monotonic_ns() - BOOTED_NS
            while not self._ended.wait(0.004):
                self.sim.step(time.monotonic_ns() - start)
        except Exception as error:
            self.failure = error

    def stop(self):
        self._ended.set()
        self.join(5.0)
        self.wire.close()
        assert self.failure is None, self.failure


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOCAL, 0))
        return probe.getsockname()[1]


def wait(condition, limit_s, what):
    until = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < until, f"no {what} within {limit_s} s"
        time.sleep(0.02)


@pytest.fixture
def flight():
    port = free_port()
    autopilot = Autopilot(port)
    client = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION))
    autopilot.start()
    plugins = []
    try:
        assert client.add_any_connection(f"udpin://{LOCAL}:{port}") == mavsdk.ConnectionResult.SUCCESS
        system = client.first_autopilot(10.0)
        assert system is not None, "MAVSDK did not discover the autopilot"
        plugins = [actions.Action(system), offboards.Offboard(system), telemetries.Telemetry(system)]
        yield autopilot.sim, system, *plugins
    finally:
        for plugin in plugins:
            plugin.destroy()
        client.destroy()
        autopilot.stop()


def test_mavsdk_arms_takes_off_commands_body_rates_and_lands(flight):
    sim, system, action, offboard, telemetry = flight
    truth = sim.truth
    assert system.get_system_id() == 1 and system.is_connected()

    # health, and what it refuses
    wait(lambda: telemetry.health().is_armable, 10.0, "armable health")
    health = telemetry.health()
    assert health.is_local_position_ok and health.is_global_position_ok and health.is_home_position_ok
    with pytest.raises(offboards.OffboardError, match="NO_SETPOINT_SET"):
        offboard.start()

    # arm and take off
    action.set_takeoff_altitude(2.5)
    action.arm()
    wait(lambda: telemetry.armed(), 3.0, "armed")
    assert truth().armed
    action.takeoff()
    wait(lambda: truth().position[2] > 0.3, 6.0, "take-off")
    with pytest.raises(actions.ActionError, match="COMMAND_DENIED"):
        action.disarm()  # not in the air
    wait(lambda: truth().position[2] > 2.0, 8.0, "climb to 2 m")
    wait(lambda: telemetry.landed_state() == telemetries.LandedState.IN_AIR, 3.0, "IN_AIR")

    # body rates, deg/s FRD: nose up brings a positive FRD pitch rate, which is a negative one in FLU
    hover = 9.80665 / 20.0
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 0.0, hover))
    offboard.start()
    wait(lambda: telemetry.flight_mode() == FlightMode.OFFBOARD, 3.0, "OFFBOARD")
    for rate, axis, sign in (
        (AttitudeRate(40.0, 0.0, 0.0, hover), 0, 1.0),
        (AttitudeRate(-40.0, 0.0, 0.0, hover), 0, -1.0),
        (AttitudeRate(0.0, 40.0, 0.0, hover), 1, -1.0),
        (AttitudeRate(0.0, -40.0, 0.0, hover), 1, 1.0),
    ):
        offboard.set_attitude_rate(rate)
        wanted = sign * math.radians(40.0)
        wait(lambda axis=axis, wanted=wanted: abs(truth().body_rate[axis] - wanted) < 0.12, 2.0, f"{wanted:+.2f} rad/s")

    # land
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 0.0, hover))
    action.land()
    wait(lambda: telemetry.flight_mode() == FlightMode.LAND, 3.0, "LAND")
    wait(lambda: not truth().armed, 18.0, "disarmed after landing")
    wait(lambda: not telemetry.armed(), 3.0, "disarmed seen by MAVSDK")
    assert truth().position[2] == pytest.approx(0.0, abs=0.05)
    assert sim.rejected["bad_frames"] == sim.rejected["garbage_bytes"] == 0


def test_mavsdk_reads_and_sets_parameters(flight):
    sim, system, *_ = flight
    params = pytest.importorskip("mavsdk.plugins.param")
    param = params.Param(system)
    assert (param.get_param_float("COM_OF_LOSS_T"), param.get_param_int("COM_OBL_RC_ACT")) == (1.0, 0)
    param.set_param_float("COM_OF_LOSS_T", 0.3)
    param.set_param_int("COM_OBL_RC_ACT", 4)
    assert param.get_param_float("COM_OF_LOSS_T") == pytest.approx(0.3)
    assert sim.flight.parameters["COM_OBL_RC_ACT"] == 4
    with pytest.raises(params.ParamError):
        param.get_param_float("NO_SUCH_PARAM")
    param.destroy()


def test_mavsdk_resends_the_last_set_point_and_kills_in_the_air(flight):
    """Why our own driver streams set-points and MAVSDK does not: its caller may be dead, and PX4 flies on."""
    sim, _, action, offboard, telemetry = flight
    hover = 9.80665 / 20.0
    wait(lambda: telemetry.health().is_armable, 10.0, "armable health")
    action.arm()
    action.takeoff()
    wait(lambda: sim.truth().position[2] > 1.0, 12.0, "climb")
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 20.0, hover))
    offboard.start()
    wait(lambda: telemetry.flight_mode() == FlightMode.OFFBOARD, 3.0, "OFFBOARD")
    time.sleep(1.5)  # no calls: with COM_OF_LOSS_T 1.0 s a stream that stopped would be a failsafe by now
    assert telemetry.flight_mode() == FlightMode.OFFBOARD
    assert not sim.flight.failsafe
    assert sim.truth().body_rate[2] < -math.radians(12.0), "clockwise from above is negative in FLU"
    action.kill()
    assert not sim.truth().armed
    wait(lambda: not telemetry.armed(), 3.0, "disarmed seen by MAVSDK")
    wait(lambda: sim.truth().position[2] < 0.01, 4.0, "fall")
