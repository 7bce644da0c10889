"""Which periodic messages a v1.17 PX4 sends on its two links, how often, and from when after boot (recorded)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from vehicle.px4.codec import MESSAGES
from vehicle.px4.sim import messages as status
from vehicle.px4.sim import motion_messages as motion
from vehicle.px4.sim.port import Port, Stream

Builder = Callable[[Any, Port], None]


class Row(NamedTuple):
    """How one message is sent; 0 Hz: only on request."""

    api_hz: float
    gcs_hz: float
    first_ms: int  # of PX4 time
    build: Builder


TABLE: dict[str, Row] = {
    "HEARTBEAT": Row(1, 1, 1188, status.heartbeat),
    "SYS_STATUS": Row(5, 1, 404, status.sys_status),
    "SYSTEM_TIME": Row(1, 0, 1204, status.system_time),
    "PING": Row(1, 0.1, 1204, status.ping),
    "LINK_NODE_STATUS": Row(1, 1, 1204, status.link_node_status),
    "GPS_RAW_INT": Row(8, 5, 136, motion.gps_raw_int),
    "SCALED_PRESSURE": Row(1, 1, 1008, motion.scaled_pressure),
    "ATTITUDE": Row(100, 50, 1592, motion.attitude),
    "ATTITUDE_QUATERNION": Row(50, 50, 1592, motion.attitude_quaternion),
    "LOCAL_POSITION_NED": Row(30, 50, 324, motion.local_position_ned),
    "GLOBAL_POSITION_INT": Row(50, 50, 2700, motion.global_position_int),
    "SERVO_OUTPUT_RAW": Row(10, 50, 304, status.servo_output_raw),
    "MISSION_CURRENT": Row(1, 1, 1004, status.mission_current),
    "VFR_HUD": Row(10, 4, 324, motion.vfr_hud),
    "ATTITUDE_TARGET": Row(10, 50, 324, motion.attitude_target),
    "POSITION_TARGET_LOCAL_NED": Row(10, 50, 324, motion.position_target_local_ned),
    "POSITION_TARGET_GLOBAL_INT": Row(10, 1, 324, motion.position_target_global_int),
    "HIGHRES_IMU": Row(50, 0, 224, motion.highres_imu),
    "TIMESYNC": Row(10, 0, 304, status.timesync),
    "DISTANCE_SENSOR": Row(10, 0.5, 304, motion.distance_sensor),
    "ALTITUDE": Row(10, 1, 304, motion.altitude),
    "BATTERY_STATUS": Row(0.5, 0.5, 2204, status.battery_status),
    "ESTIMATOR_STATUS": Row(1, 0.5, 1204, status.estimator_status),
    "VIBRATION": Row(0.5, 0.1, 2204, status.vibration),
    "HOME_POSITION": Row(0.5, 0.5, 2204, motion.home_position),
    "EXTENDED_SYS_STATE": Row(5, 1, 404, status.extended_sys_state),
    "ODOMETRY": Row(30, 0, 324, motion.odometry),
    "TIME_ESTIMATE_TO_TARGET": Row(0.5, 0.5, 2004, motion.time_estimate),
    "CURRENT_EVENT_SEQUENCE": Row(0.35, 0.35, 260, status.current_event_sequence),
    "CURRENT_MODE": Row(0.5, 0.5, 2204, status.current_mode),
    "GNSS_INTEGRITY": Row(1, 1, 1204, status.gnss_integrity),
    "OPEN_DRONE_ID_LOCATION": Row(1, 1, 1204, status.open_drone_id_location),
    "OPEN_DRONE_ID_SYSTEM": Row(1, 1, 1204, status.open_drone_id_system),
    "ORBIT_EXECUTION_STATUS": Row(5, 2, 324, motion.orbit_execution_status),
    "HIL_STATE_QUATERNION": Row(0, 0, 1204, motion.hil_state_quaternion),
}


def add_streams(port: Port, link: str) -> None:
    """Give a port the streams of the "api" or of the "gcs" link."""
    for name, row in TABLE.items():
        hz = row.api_hz if link == "api" else row.gcs_hz
        interval = round(1e9 / hz) if hz else 0
        port.add(Stream(MESSAGES[name].id, interval, row.first_ms * 1_000_000, row.build))
