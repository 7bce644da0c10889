"""How the software PX4 fills its periodic messages on motion, set-points and sensors; builders as in `messages`.

Values that carry no information here (temperatures) are the constants that a real SITL was recorded to send.
"""

from __future__ import annotations

import math

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.sim.port import Port
from vehicle.px4.sim.rows import snapshot
from vehicle.px4.sim.view import View
from vehicle.quadrotor.airframe import GRAVITY

NAN = math.nan
_MAG_FIELD = (0.215, 0.0186, 0.42)  # gauss, NED, at the origin
PRESSURE_ASL, SCALE_HEIGHT = 1013.25, 8434.0  # hPa, m


def gps_raw_int(v: View, port: Port) -> None:
    if not v.estimator.gps_active:
        port.send(M["GPS_RAW_INT"], v.us, 0, 0, 0, 0, 65535, 65535, 65535, 65535, 255, *(0,) * 6)
        return
    s = v.snap
    vx, vy, _ = s[snapshot.VELOCITY : snapshot.VELOCITY + 3]
    speed = math.hypot(vx, vy)
    course = round(math.degrees(math.atan2(vy, vx)) % 360.0 * 100) % 36000
    lat, lon, alt = v.geodetic
    port.send(
        M["GPS_RAW_INT"], v.us, 3, lat, lon, alt, 70, 110, round(speed * 100), course, 10, alt, 900, 1780, 400, 0, 0
    )


def scaled_pressure(v: View, port: Port) -> None:
    port.send(M["SCALED_PRESSURE"], v.ms, _pressure(v), 0.0, 1182, 0)


def _pressure(v: View) -> float:
    return PRESSURE_ASL * math.exp(-v.flight.altitude(v.flight.true_position[2]) / SCALE_HEIGHT)


def attitude(v: View, port: Port) -> None:
    s = v.snap
    port.send(M["ATTITUDE"], v.ms, *s[snapshot.EULER : snapshot.EULER + 3], *s[snapshot.RATE : snapshot.RATE + 3])


def attitude_quaternion(v: View, port: Port) -> None:
    s = v.snap
    rates = s[snapshot.RATE : snapshot.RATE + 3]
    q = s[snapshot.ATTITUDE : snapshot.ATTITUDE + 4]
    port.send(M["ATTITUDE_QUATERNION"], v.ms, *q, *rates, (0.0, 0.0, 0.0, 0.0))


def local_position_ned(v: View, port: Port) -> None:
    port.send(M["LOCAL_POSITION_NED"], v.ms, *v.snap[snapshot.POSITION : snapshot.VELOCITY + 3])


def global_position_int(v: View, port: Port) -> None:
    if not v.flight.global_valid:
        return
    s = v.snap
    lat, lon, alt = v.geodetic
    home = v.flight.home
    relative = round((v.flight.position[2] - home[2]) * 1000) if home else 0
    heading = round(math.degrees(s[snapshot.EULER + 2]) % 360.0 * 100) % 36000
    velocity = (_int16(s[snapshot.VELOCITY + i] * 100) for i in range(3))
    port.send(M["GLOBAL_POSITION_INT"], v.ms, lat, lon, alt, relative, *velocity, heading)


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))


def vfr_hud(v: View, port: Port) -> None:
    s = v.snap
    heading = int(math.degrees(s[snapshot.EULER + 2]) % 360.0)
    throttle = int(100 * v.thrust) if v.flight.armed else 0
    altitude = v.flight.altitude(v.flight.position[2])
    vx, vy, vz = s[snapshot.VELOCITY : snapshot.VELOCITY + 3]
    port.send(M["VFR_HUD"], NAN, math.hypot(vx, vy), heading, throttle, altitude, -vz)


def attitude_target(v: View, port: Port) -> None:
    q, thrust = v.attitude_setpoint()  # stale while rates are flown, as on a real PX4
    port.send(M["ATTITUDE_TARGET"], v.ms, 0, q, *v.rate_setpoint(), thrust)


def position_target_local_ned(v: View, port: Port) -> None:
    target = v.position_setpoint()
    if target is not None:
        port.send(M["POSITION_TARGET_LOCAL_NED"], v.ms, 1, *target)


def position_target_global_int(v: View, port: Port) -> None:
    flight = v.flight
    flying = flight.armed and (flight.took_off or flight.active != px4.HOLD)
    if not flying or px4.split_custom_mode(flight.active)[0] != px4.Main.AUTO:
        return
    target = v.position_setpoint()
    if target is None or not flight.global_valid:
        return
    _, x, y, z, *rest = target
    ox, oy, oz = flight.origin
    x, y, z = (0.0 if math.isnan(c) else c for c in (x, y, z))
    lat, lon = flight.geodetic(y + ox, x + oy)
    port.send(M["POSITION_TARGET_GLOBAL_INT"], v.ms, 5, 0, lat, lon, flight.altitude(oz - z), *rest)


def highres_imu(v: View, port: Port) -> None:
    s = v.snap
    yaw = s[snapshot.EULER + 2]
    mag = (
        math.cos(yaw) * _MAG_FIELD[0] + math.sin(yaw) * _MAG_FIELD[1],
        -math.sin(yaw) * _MAG_FIELD[0] + math.cos(yaw) * _MAG_FIELD[1],
        _MAG_FIELD[2],
    )
    altitude = v.flight.altitude(v.flight.true_position[2])
    port.send(
        M["HIGHRES_IMU"],
        v.us,
        *s[snapshot.ACCELERATION : snapshot.ACCELERATION + 3],
        *s[snapshot.GYRO : snapshot.GYRO + 3],
        *mag,
        _pressure(v),
        0.0,
        altitude,
        15.0,
        63,
        0,
    )


def distance_sensor(v: View, port: Port) -> None:
    centimetres = max(0, min(10000, round(v.height() * 100)))
    port.send(M["DISTANCE_SENSOR"], v.ms, 0, 10000, centimetres, 0, 0, 25, 0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), 0)


def altitude(v: View, port: Port) -> None:
    z = v.flight.position[2]
    local = z - v.flight.origin[2]
    relative = z - v.flight.home[2] if v.flight.home else NAN
    amsl, height = v.flight.altitude(z), v.height()
    port.send(M["ALTITUDE"], v.us, amsl, amsl, local, relative, local - height, height)


def home_position(v: View, port: Port) -> None:
    flight = v.flight
    if flight.home is None:
        return
    x, y, z = flight.home
    lat, lon = flight.geodetic(x, y)
    ox, oy, oz = flight.origin
    port.send(
        M["HOME_POSITION"],
        lat,
        lon,
        round(flight.altitude(z) * 1000),
        y - oy,
        x - ox,
        oz - z,
        v.home_attitude,
        0.0,
        0.0,
        0.0,
        flight.home_ns // 1000,
    )


def odometry(v: View, port: Port) -> None:
    s = v.snap
    port.send(
        M["ODOMETRY"],
        v.sample_us,
        1,
        1,  # velocity in NED, not in the body
        *s[snapshot.POSITION : snapshot.POSITION + 3],
        tuple(s[snapshot.ATTITUDE : snapshot.ATTITUDE + 4]),
        *s[snapshot.VELOCITY : snapshot.VELOCITY + 3],
        *s[snapshot.RATE : snapshot.RATE + 3],
        v.pose_covariance,
        v.velocity_covariance,
        v.reset_counter,
        px4.ESTIMATOR_AUTOPILOT,
        0,
    )


def time_estimate(v: View, port: Port) -> None:
    home, flight = v.flight.home, v.flight
    seconds = 0
    if flight.armed and not flight.landed and home is not None:
        x, y, z = flight.position
        seconds = round(100 + 1.1 * (math.hypot(x - home[0], y - home[1]) / 5.0 + abs(z - home[2]) / 0.7))
    port.send(M["TIME_ESTIMATE_TO_TARGET"], seconds, -1, -1, -1, -1)


def orbit_execution_status(v: View, port: Port) -> None:
    flight, orbit = v.flight, v.commander.orbit
    if flight.active != px4.ORBIT or not flight.global_valid:
        return
    x, y, z = orbit.centre.tolist()
    lat, lon = flight.geodetic(x, y)
    port.send(M["ORBIT_EXECUTION_STATUS"], v.us, orbit.radius, 0, lat, lon, flight.altitude(z))


def hil_state_quaternion(v: View, port: Port) -> None:
    """SIH's ground truth; its time_usec is 0 on a real PX4 too."""
    t = v.truth_ned()
    lat, lon = v.flight.geodetic(*v.flight.true_position[:2])
    alt = round(v.flight.altitude(v.flight.true_position[2]) * 1000)
    velocity = (_int16(c * 100) for c in t.velocity)
    acceleration = (_int16(c / GRAVITY * 1000) for c in t.acceleration)
    port.send(M["HIL_STATE_QUATERNION"], 0, t.attitude, *t.rates, lat, lon, alt, *velocity, 0, 0, *acceleration)


def gps_global_origin(v: View, port: Port) -> None:
    lat, lon = v.flight.geodetic(v.flight.origin[0], v.flight.origin[1])
    port.send(M["GPS_GLOBAL_ORIGIN"], lat, lon, round(v.flight.altitude(v.flight.origin[2]) * 1000), v.us)
