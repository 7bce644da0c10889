"""What MAVSDK-Python's examples ask of an autopilot beyond take-off and OFFBOARD, asked of the software PX4."""

import json
import math

import pytest

from hil.host.pytest_px4 import px4_sim  # noqa: F401  (the fixture starts the autopilot)
from tests.contract.mavsdk_client import Connection, mavsdk, persist, wait
from vehicle.px4.sim.services.files import PARAMETERS

actions = pytest.importorskip("mavsdk.plugins.action")
telemetries = pytest.importorskip("mavsdk.plugins.telemetry")
FlightMode = telemetries.FlightMode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]
SPEED = 4.0  # PX4's time over wall time
PATIENT = {"COM_RC_LOSS_T": 60.0, "COM_OF_LOSS_T": 60.0}  # s: a busy machine may stall the client


@pytest.fixture
def connected(px4_sim):  # noqa: F811
    px4 = px4_sim(seed=1, speed=SPEED, parameters=PATIENT)
    connection = Connection(px4.url)
    plugins = []

    def plugin(module, name):
        plugins.append(getattr(pytest.importorskip(f"mavsdk.plugins.{module}"), name)(connection.system))
        return plugins[-1]

    yield px4, connection, plugin
    for one in plugins:
        one.destroy()
    connection.close()


def airborne(px4, action, telemetry):
    wait(lambda: telemetry.health().is_armable, "armable health")
    persist(action.arm)
    persist(action.takeoff)
    wait(lambda: px4.truth().position[2] > 1.7, "climb")


def test_mission_is_uploaded_flown_paused_and_finished(connected):
    px4, connection, plugin = connected
    missions = pytest.importorskip("mavsdk.plugins.mission")
    action, _, telemetry = connection.plugins
    mission = plugin("mission", "Mission")
    wait(lambda: telemetry.health().is_armable, "armable health")
    with px4.held() as autopilot:
        places = [tuple(v / 1e7 for v in autopilot.flight.geodetic(*at)) for at in ((4.0, 0.0), (4.0, 30.0))]
    items = [
        missions.MissionItem(lat, lon, 4.0, 6.0, is_fly_through=True, gimbal_pitch_deg=-45.0, gimbal_yaw_deg=0.0)
        for lat, lon in places
    ]
    mission.set_return_to_launch_after_mission(False)
    persist(lambda: mission.upload_mission(missions.MissionPlan(items)))
    got = persist(mission.download_mission).mission_items
    assert [m.latitude_deg for m in got] == pytest.approx([lat for lat, _ in places], abs=1e-6)
    assert [m.longitude_deg for m in got] == pytest.approx([lon for _, lon in places], abs=1e-6)

    persist(action.arm)
    persist(mission.start_mission)
    wait(lambda: telemetry.flight_mode() == FlightMode.MISSION, "Mission mode")
    wait(lambda: mission.mission_progress().current == 1, "first place reached")
    persist(mission.pause_mission)
    wait(lambda: telemetry.flight_mode() == FlightMode.HOLD, "Hold")
    wait(lambda: math.hypot(*px4.truth().velocity) < 0.3, "rest")
    assert not persist(mission.is_mission_finished) and px4.truth().position[1] < 28.0
    persist(mission.start_mission)
    wait(lambda: mission.mission_progress().current == 2, "last place reached")
    assert persist(mission.is_mission_finished)
    wait(lambda: math.hypot(*px4.truth().velocity) < 0.3, "rest at the last place")
    x, y, z = px4.truth().position
    assert math.hypot(x - 4.0, y - 30.0) < got[-1].acceptance_radius_m and z == pytest.approx(4.0, abs=0.5)
    persist(mission.clear_mission)
    persist(action.land)


def test_goto_location_and_orbit_are_flown(connected):
    px4, connection, _ = connected
    action, _, telemetry = connection.plugins
    airborne(px4, action, telemetry)
    with px4.held() as autopilot:
        flight = autopilot.flight
        lat, lon = (v / 1e7 for v in flight.geodetic(6.0, 2.0))
        altitude = flight.altitude(4.0)
    persist(lambda: action.goto_location(lat, lon, altitude, 45.0))
    wait(lambda: math.dist(px4.truth().position, (6.0, 2.0, 4.0)) < 0.7, "place")
    persist(lambda: action.do_orbit(3.0, 2.0, actions.OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER, lat, lon, altitude))
    wait(lambda: math.hypot(*px4.truth().velocity[:2]) > 1.5, "speed on the circle")
    wait(lambda: abs(math.dist(px4.truth().position[:2], (6.0, 2.0)) - 3.0) < 0.6, "circle")
    persist(action.hold)
    wait(lambda: telemetry.flight_mode() == FlightMode.HOLD, "Hold")


def test_pilot_flies_by_manual_control(connected):
    px4, connection, plugin = connected
    action, _, telemetry = connection.plugins
    manual = plugin("manual_control", "ManualControl")
    airborne(px4, action, telemetry)
    manual.set_manual_control_input(0.0, 0.0, 0.5, 0.0)
    persist(manual.start_position_control)
    wait(lambda: telemetry.flight_mode() == FlightMode.POSCTL, "Position mode")
    east = px4.truth().position[0]

    def moved():
        manual.set_manual_control_input(0.5, 0.0, 0.5, 0.0)
        return px4.truth().position[0] > east + 2.0

    wait(moved, "flight to the front, which is east")


def test_files_metadata_logs_and_geofence_are_answered(connected):
    _, _, plugin = connected
    ftps = pytest.importorskip("mavsdk.plugins.ftp")
    fences = pytest.importorskip("mavsdk.plugins.geofence")
    logs = pytest.importorskip("mavsdk.plugins.log_files")
    components = pytest.importorskip("mavsdk.plugins.component_metadata")
    ftp = plugin("ftp", "Ftp")
    listed = persist(lambda: ftp.list_directory("/etc/extras"))
    assert sorted(entry.name for entry in listed.entries) == ["component_general.json.xz", "parameters.json.xz"]
    with pytest.raises(ftps.FtpError, match="FILE_PROTECTED"):
        ftp.create_directory("/mine")

    with pytest.raises(logs.LogFilesError, match="NO_LOGFILES"):
        plugin("log_files", "LogFiles").get_entries()

    fence, points = plugin("geofence", "Geofence"), [fences.Point(47.0 + 0.01 * i, 8.0) for i in range(4)]
    polygon = fences.Polygon(points, fences.FenceType.INCLUSION)
    persist(lambda: fence.upload_geofence(fences.GeofenceData([polygon], [])))
    assert len(persist(fence.download_geofence).polygons[0].points) == 4

    component = plugin("component_metadata", "ComponentMetadata")
    component.request_autopilot_component()
    found = []

    def described():
        try:
            found.append(component.get_metadata(1, components.MetadataType.PARAMETER))
        except mavsdk.exceptions.MavsdkError:
            return False
        return True

    wait(described, f"metadata of the parameters, from {PARAMETERS}")
    assert len(json.loads(found[-1].json_metadata)["parameters"]) == 887
