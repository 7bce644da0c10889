"""MAVSDK, a client from another project, flies the software PX4 over UDP in real time, as it flies a real one."""

import math
import re
import signal
import subprocess
import sys
import time

import pytest

from hil.host.pytest_px4 import px4_sim  # noqa: F401  (the fixture starts the autopilot)
from tests.contract.mavsdk_client import LIMIT_S, Connection, persist, wait
from tests.paths import ROOT

actions = pytest.importorskip("mavsdk.plugins.action")
offboards = pytest.importorskip("mavsdk.plugins.offboard")
telemetries = pytest.importorskip("mavsdk.plugins.telemetry")
AttitudeRate, PositionNedYaw = offboards.AttitudeRate, offboards.PositionNedYaw
FlightMode = telemetries.FlightMode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.fixture
def flight(px4_sim):  # noqa: F811
    px4 = px4_sim(seed=1)
    connection = Connection(px4.url)
    yield px4, connection.system, *connection.plugins
    connection.close()


def test_mavsdk_arms_takes_off_commands_body_rates_and_lands(flight):
    px4, system, action, offboard, telemetry = flight
    truth = px4.truth
    assert system.get_system_id() == 1 and system.is_connected()

    # health, and what it refuses
    wait(lambda: telemetry.health().is_armable, "armable health")
    health = telemetry.health()
    assert health.is_local_position_ok and health.is_global_position_ok and health.is_home_position_ok
    with pytest.raises(offboards.OffboardError, match="NO_SETPOINT_SET"):
        offboard.start()

    # arm and take off
    action.set_takeoff_altitude(2.5)
    persist(action.arm)
    wait(lambda: telemetry.armed(), "armed")
    assert truth().armed
    persist(action.takeoff)
    wait(lambda: truth().position[2] > 0.3, "take-off")
    with pytest.raises(actions.ActionError, match="COMMAND_DENIED"):
        persist(action.disarm)  # not in the air
    wait(lambda: truth().position[2] > 1.7, "climb")
    wait(lambda: telemetry.landed_state() == telemetries.LandedState.IN_AIR, "IN_AIR")

    # body rates, deg/s FRD: nose up brings a positive FRD pitch rate, which is a negative one in FLU
    hover = 9.80665 / 20.0
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 0.0, hover))
    persist(offboard.start)
    wait(lambda: telemetry.flight_mode() == FlightMode.OFFBOARD, "OFFBOARD")
    for rate, axis, sign in (
        (AttitudeRate(40.0, 0.0, 0.0, hover), 0, 1.0),
        (AttitudeRate(-40.0, 0.0, 0.0, hover), 0, -1.0),
        (AttitudeRate(0.0, 40.0, 0.0, hover), 1, -1.0),
        (AttitudeRate(0.0, -40.0, 0.0, hover), 1, 1.0),
    ):
        offboard.set_attitude_rate(rate)
        wanted = sign * math.radians(40.0)
        wait(lambda axis=axis, wanted=wanted: abs(truth().body_rate[axis] - wanted) < 0.12, f"{wanted:+.2f} rad/s")

    # land
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 0.0, hover))
    persist(action.land)
    wait(lambda: telemetry.flight_mode() == FlightMode.LAND, "LAND")
    wait(lambda: not truth().armed, "disarmed after landing")
    wait(lambda: not telemetry.armed(), "disarmed seen by MAVSDK")
    assert truth().position[2] == pytest.approx(0.0, abs=0.05)
    with px4.held() as autopilot:
        assert autopilot.rejected["bad_frames"] == autopilot.rejected["garbage_bytes"] == 0


def test_mavsdk_reads_and_sets_parameters(flight):
    px4, system, *_ = flight
    params = pytest.importorskip("mavsdk.plugins.param")
    param = params.Param(system)
    assert (param.get_param_float("COM_OF_LOSS_T"), param.get_param_int("COM_OBL_RC_ACT")) == (1.0, 0)
    param.set_param_float("COM_OF_LOSS_T", 0.3)
    param.set_param_int("COM_OBL_RC_ACT", 4)
    assert param.get_param_float("COM_OF_LOSS_T") == pytest.approx(0.3)
    with px4.held() as autopilot:
        assert autopilot.flight.parameters["COM_OBL_RC_ACT"] == 4
    with pytest.raises(params.ParamError):
        param.get_param_float("NO_SUCH_PARAM")
    param.destroy()


def test_mavsdk_resends_the_last_set_point_and_kills_in_the_air(flight):
    """Why our own driver streams set-points and MAVSDK does not: its caller may be dead, and PX4 flies on."""
    px4, _, action, offboard, telemetry = flight
    hover = 9.80665 / 20.0
    wait(lambda: telemetry.health().is_armable, "armable health")
    persist(action.arm)
    persist(action.takeoff)
    wait(lambda: px4.truth().position[2] > 1.0, "climb")
    offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 20.0, hover))
    persist(offboard.start)
    wait(lambda: telemetry.flight_mode() == FlightMode.OFFBOARD, "OFFBOARD")
    time.sleep(1.5)  # no calls: with COM_OF_LOSS_T 1.0 s a stream that stopped would be a failsafe by now
    assert telemetry.flight_mode() == FlightMode.OFFBOARD
    with px4.held() as autopilot:
        assert not autopilot.flight.failsafe
    assert px4.truth().body_rate[2] < -math.radians(12.0), "clockwise from above is negative in FLU"
    persist(action.kill)
    assert not px4.truth().armed
    wait(lambda: not telemetry.armed(), "disarmed seen by MAVSDK")
    wait(lambda: px4.truth().position[2] < 0.01, "fall")


@pytest.fixture
def command():
    """`perch-hil px4` on a free port at four times real time, and where it says that it is."""
    arguments = ["px4", "--listen", "udp://:0", "--gcs", "none", "--speed", "4", "--param", "COM_OF_LOSS_T=60"]
    process = subprocess.Popen([sys.executable, "-m", "hil", *arguments], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        yield process, re.search(r"PX4 at (127\.0\.0\.1:\d+) waits for a client", process.stdout.readline())[1]
    finally:
        process.kill()
        process.wait()


def test_sequence_of_mavsdk_s_examples_flies_against_the_command(command):
    """takeoff_and_land.py and offboard_position_ned.py of MAVSDK-Python, with its present interface."""
    process, address = command
    connection = Connection(f"udpout://{address}")
    action, offboard, telemetry = connection.plugins
    try:
        wait(lambda: telemetry.health().is_global_position_ok and telemetry.health().is_home_position_ok, "health")
        wait(lambda: telemetry.health().is_armable, "armable health")
        persist(action.arm)
        persist(action.takeoff)
        wait(lambda: telemetry.position().relative_altitude_m > 1.5, "climb")

        offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -3.0, 0.0))
        persist(offboard.start)
        for north, east, down in ((0.0, 0.0, -3.0), (3.0, 0.0, -3.0), (3.0, 4.0, -3.0)):
            offboard.set_position_ned(PositionNedYaw(north, east, down, 90.0))
            wanted = (north, east, down)

            def there(wanted=wanted):
                at = telemetry.position_velocity_ned().position
                return math.dist((at.north_m, at.east_m, at.down_m), wanted) < 0.4

            wait(there, f"set-point {wanted} reached")
        persist(offboard.stop)

        persist(action.land)
        wait(lambda: telemetry.landed_state() == telemetries.LandedState.ON_GROUND, "landing")
        wait(lambda: not telemetry.armed(), "disarmed by itself")
    finally:
        connection.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(LIMIT_S) == 0
