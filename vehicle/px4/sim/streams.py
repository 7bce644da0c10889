"""Which periodic messages a v1.17 PX4 sends on its two links, how often, and from when after boot (recorded)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from vehicle.px4.codec import MESSAGES
from vehicle.px4.sim import messages as build
from vehicle.px4.sim.port import Port, Stream

Builder = Callable[[Any, Port], None]


class Row(NamedTuple):
    """How one message is sent; 0 Hz: only on request."""

    api_hz: float
    gcs_hz: float
    first_ms: int  # of PX4 time
    build: Builder


TABLE: dict[str, Row] = {
    "HEARTBEAT": Row(1, 1, 1188, build.heartbeat),
    "SYS_STATUS": Row(5, 1, 404, build.sys_status),
    "SYSTEM_TIME": Row(1, 0, 1204, build.system_time),
    "PING": Row(1, 0.1, 1204, build.ping),
    "LINK_NODE_STATUS": Row(1, 1, 1204, build.link_node_status),
    "GPS_RAW_INT": Row(8, 5, 136, build.gps_raw_int),
    "SCALED_PRESSURE": Row(1, 1, 1008, build.scaled_pressure),
    "ATTITUDE": Row(100, 50, 1592, build.attitude),
    "ATTITUDE_QUATERNION": Row(50, 50, 1592, build.attitude_quaternion),
    "LOCAL_POSITION_NED": Row(30, 50, 324, build.local_position_ned),
    "GLOBAL_POSITION_INT": Row(50, 50, 2700, build.global_position_int),
    "SERVO_OUTPUT_RAW": Row(10, 50, 304, build.servo_output_raw),
    "MISSION_CURRENT": Row(1, 1, 1004, build.mission_current),
    "VFR_HUD": Row(10, 4, 324, build.vfr_hud),
    "ATTITUDE_TARGET": Row(10, 50, 324, build.attitude_target),
    "POSITION_TARGET_LOCAL_NED": Row(10, 50, 324, build.position_target_local_ned),
    "POSITION_TARGET_GLOBAL_INT": Row(10, 1, 324, build.position_target_global_int),
    "HIGHRES_IMU": Row(50, 0, 224, build.highres_imu),
    "TIMESYNC": Row(10, 0, 304, build.timesync),
    "DISTANCE_SENSOR": Row(10, 0.5, 304, build.distance_sensor),
    "ALTITUDE": Row(10, 1, 304, build.altitude),
    "BATTERY_STATUS": Row(0.5, 0.5, 2204, build.battery_status),
    "ESTIMATOR_STATUS": Row(1, 0.5, 1204, build.estimator_status),
    "VIBRATION": Row(0.5, 0.1, 2204, build.vibration),
    "HOME_POSITION": Row(0.5, 0.5, 2204, build.home_position),
    "EXTENDED_SYS_STATE": Row(5, 1, 404, build.extended_sys_state),
    "ODOMETRY": Row(30, 0, 324, build.odometry),
    "TIME_ESTIMATE_TO_TARGET": Row(0.5, 0.5, 2004, build.time_estimate),
    "CURRENT_EVENT_SEQUENCE": Row(0.35, 0.35, 260, build.current_event_sequence),
    "CURRENT_MODE": Row(0.5, 0.5, 2204, build.current_mode),
    "GNSS_INTEGRITY": Row(1, 1, 1204, build.gnss_integrity),
    "OPEN_DRONE_ID_LOCATION": Row(1, 1, 1204, build.open_drone_id_location),
    "OPEN_DRONE_ID_SYSTEM": Row(1, 1, 1204, build.open_drone_id_system),
    "HIL_STATE_QUATERNION": Row(0, 0, 1204, build.hil_state_quaternion),
}


def add_streams(port: Port, link: str) -> None:
    """Give a port the streams of the "api" or of the "gcs" link."""
    for name, row in TABLE.items():
        hz = row.api_hz if link == "api" else row.gcs_hz
        interval = round(1e9 / hz) if hz else 0
        port.add(Stream(MESSAGES[name].id, interval, row.first_ms * 1_000_000, row.build))
