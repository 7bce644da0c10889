"""How the software PX4 fills its periodic messages on its own state; builders take the tick's view and the port.

Values that carry no information here (remote id, jamming) are the constants that a real SITL was recorded to send.
"""

from __future__ import annotations

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.sim.port import Port
from vehicle.px4.sim.view import View

NAN = float("nan")
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
    port.send(M["MISSION_CURRENT"], 0, 65535, 1, 2)


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
    standard = {px4.HOLD: 0, px4.TAKEOFF: 8, px4.RTL: 5, px4.LAND: 7}.get(flight.active, 0)
    port.send(M["CURRENT_MODE"], standard, flight.active, flight.intended)


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
