"""How the software PX4 fills its periodic messages on its own state; builders take the tick's view and the port.

Values that carry no information here (remote id, jamming) are the constants that a real SITL was recorded to send.
"""

from __future__ import annotations

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.sim.port import Port
from vehicle.px4.sim.view import View

NAN = float("nan")
CAPABILITIES, FLIGHT_VERSION, UID = 59647, 17891583, 5283920058631409231
GIT_HASH = bytes.fromhex("d6f12ad1c4f70000")  # of the release
CUSTOM_VERSION = bytes(3) + GIT_HASH[4::-1]  # its first 5 bytes, the least one first, after a vendor version of 0.0.0
MODES = (  # MAV_STANDARD_MODE, custom mode, name
    (0, px4.custom_mode(px4.Main.MANUAL), "Manual"),
    (0, px4.ALTCTL, "Altitude"),
    (1, px4.POSCTL, "Position"),
    (6, px4.MISSION, "Mission"),
    (0, px4.HOLD, "Hold"),
    (5, px4.RTL, "Return"),
    (8, px4.TAKEOFF, "Takeoff"),
    (7, px4.LAND, "Land"),
    (0, px4.custom_mode(px4.Main.ACRO), "Acro"),
    (0, px4.OFFBOARD, "Offboard"),
    (0, px4.custom_mode(px4.Main.STABILIZED), "Stabilized"),
)
STANDARD_MODES = {custom: standard for standard, custom, _ in MODES} | {px4.ORBIT: 2}
_ZERO20 = (0,) * 20


def heartbeat(v: View, port: Port) -> None:
    port.send(
        M["HEARTBEAT"],
        px4.TYPE_QUADROTOR,
        px4.AUTOPILOT_PX4,
        v.commander.base_mode(),
        v.flight.active,
        int(v.commander.system_status()),
        3,
    )


def sys_status(v: View, port: Port) -> None:
    flight = v.flight
    present, enabled, health = 0x300402F, 0x301402F, 0x320C83F
    if v.ms < 2000:
        present, enabled, health = 0, 0, 0x321C83F
    elif not flight.ready:
        present, enabled, health = 0x300400F, 0x301400F, 0x320883F
    if flight.ready and (flight.armed or v.commander.can_arm()):
        health |= px4.PREARM_CHECK
    millivolts, percent = v.battery()
    port.send(M["SYS_STATUS"], present, enabled, health, 120, millivolts, -100, percent, 0, 0, 0, 0, 0, 0, 0, 0, 1)


def system_time(v: View, port: Port) -> None:
    port.send(M["SYSTEM_TIME"], v.epoch_us + v.us, v.ms)


def ping(v: View, port: Port) -> None:
    port.send(M["PING"], v.us, v.count("ping"), 0, 0)


def link_node_status(v: View, port: Port) -> None:
    seconds = max(1e-3, v.flight.now_s)
    port.send(
        M["LINK_NODE_STATUS"],
        v.us,
        0,
        0,
        int(port.sent_bytes / seconds),
        int(port.received_bytes / seconds),
        port.parser.bad_frames & 0xFFFF,
        0,
        0,
        port.sent,
        port.received,
        0,
    )


def servo_output_raw(v: View, port: Port) -> None:
    motors = (900, 900, 900, 900)
    if v.flight.armed and not v.flight.terminated:
        motors = v.servos()
    port.send(M["SERVO_OUTPUT_RAW"], v.us & 0xFFFFFFFF, 0, *motors, *(900,) * 12)


def mission_current(v: View, port: Port) -> None:
    flight, plan = v.flight, v.flight.plan
    active = flight.active in (px4.MISSION, px4.TAKEOFF, px4.LAND)
    state = px4.MissionState.NOT_STARTED
    if not plan.mission:
        state = px4.MissionState.NO_MISSION
    elif plan.finished:
        state = px4.MissionState.COMPLETE
    elif active:
        state = px4.MissionState.ACTIVE
    elif plan.reached >= 0:
        state = px4.MissionState.PAUSED
    port.send(M["MISSION_CURRENT"], plan.current, len(plan.mission) or 65535, int(state), 1 if active else 2)


def autopilot_version(port: Port) -> None:
    """AUTOPILOT_VERSION of the release."""
    version = (CAPABILITIES, FLIGHT_VERSION, FLIGHT_VERSION, 0, 0)
    port.send(M["AUTOPILOT_VERSION"], *version, CUSTOM_VERSION, CUSTOM_VERSION, (0,) * 8, 0, 0, UID, (0,) * 18)


def available_modes(port: Port) -> None:
    """AVAILABLE_MODES, one message a mode."""
    for index, (standard, custom, name) in enumerate(MODES, 1):
        port.send_name("AVAILABLE_MODES", len(MODES), index, standard, custom, 0, name)


def timesync(v: View, port: Port) -> None:
    port.send(M["TIMESYNC"], 0, v.flight.now_ns, 0, 0)


def battery_status(v: View, port: Port) -> None:
    millivolts, percent = v.battery()
    voltages = (millivolts, *(65535,) * 9)
    port.send(M["BATTERY_STATUS"], 0, 1, 1, 32767, voltages, -100, 0, -1, percent, 0, 1, (0, 0, 0, 0), 0, 0)


def estimator_status(v: View, port: Port) -> None:
    flags = 895 if v.flight.position_valid else 164
    port.send(M["ESTIMATOR_STATUS"], v.us, flags, 0.05, 0.04, 0.02, 0.07, 0.003, NAN, 0.3, 0.2)


def vibration(v: View, port: Port) -> None:
    port.send(M["VIBRATION"], v.us, 0.0, 0.01, 0.1, 0, 0, 0)


def extended_sys_state(v: View, port: Port) -> None:
    flight = v.flight
    state = px4.Landed.IN_AIR
    if flight.landed:
        state = px4.Landed.ON_GROUND
    elif flight.active == px4.TAKEOFF:
        state = px4.Landed.TAKEOFF
    elif flight.landing:
        state = px4.Landed.LANDING
    port.send(M["EXTENDED_SYS_STATE"], 0, int(state))


def current_event_sequence(v: View, port: Port) -> None:
    port.send(M["CURRENT_EVENT_SEQUENCE"], v.event_sequence & 0xFFFF, 0)


def current_mode(v: View, port: Port) -> None:
    flight = v.flight
    port.send(M["CURRENT_MODE"], STANDARD_MODES.get(flight.active, 0), flight.active, flight.intended)


def gnss_integrity(v: View, port: Port) -> None:
    port.send(M["GNSS_INTEGRITY"], 4, 0, 0, 0, 0, 0, 65535, 65535, 255, 255, 255, 255)


def open_drone_id_location(v: View, port: Port) -> None:
    lat, lon, alt = v.geodetic
    status = 1 if v.flight.landed else 2
    height = v.height()
    port.send(
        M["OPEN_DRONE_ID_LOCATION"],
        0, 0, _ZERO20, status, 0, 0, 0, lat, lon, alt / 1000, alt / 1000, 0, height, 12, 5, 0, 3, 65535.0, 0,
    )  # fmt: skip


def open_drone_id_system(v: View, port: Port) -> None:
    home = v.flight.home or v.flight.origin
    lat, lon = v.flight.geodetic(home[0], home[1])
    amsl = v.flight.altitude(home[2])
    port.send(M["OPEN_DRONE_ID_SYSTEM"], 0, 0, _ZERO20, 0, 0, lat, lon, 1, 0, -1000.0, -1000.0, 0, 0, amsl, 2748666496)
