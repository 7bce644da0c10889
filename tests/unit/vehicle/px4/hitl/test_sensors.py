"""Simulated sensors against closed forms, and against what PX4's estimator accepts."""

import math

import numpy as np
import pytest

from kernel.random import stream
from kernel.rotations import from_euler
from vehicle.px4 import place
from vehicle.px4.hitl import rows
from vehicle.px4.hitl.sensors import QUIET, SensorNoise, draw_errors, sense, sense_gps
from vehicle.quadrotor import state_row
from vehicle.quadrotor.dynamics import vehicle_row

NO_ERROR = np.zeros(rows.ERROR_LENGTH)
G = 9.80665


def reading(row, error=NO_ERROR, noise=QUIET, seed=1):
    out = np.zeros(rows.READING_LENGTH)
    sense(row, error, noise.row(), stream(seed), out)
    return out


def at(position=(0.0, 0.0, 0.0), roll=0.0, pitch=0.0, yaw=0.0):
    return vehicle_row(position, from_euler(roll, pitch, yaw))


def test_accelerometer_at_rest_shows_gravity_upwards():
    assert reading(at())[rows.ACCEL : rows.ACCEL + 3] == pytest.approx((0.0, 0.0, -G))


def test_specific_force_and_body_rate_come_in_forward_right_down():
    row = at()
    row[state_row.F : state_row.F + 3] = 1.0, 2.0, 3.0
    row[state_row.W : state_row.W + 3] = 0.1, 0.2, 0.3
    out = reading(row)
    assert out[rows.ACCEL : rows.ACCEL + 3] == pytest.approx((1.0, -2.0, -3.0))
    assert out[rows.GYRO : rows.GYRO + 3] == pytest.approx((0.1, -0.2, -0.3))


@pytest.mark.parametrize("heading_deg", [0.0, 30.0, 90.0, 180.0, 300.0])
def test_compass_gives_the_true_heading_after_the_declination(heading_deg):
    heading = math.radians(heading_deg)
    x, y, z = reading(at(yaw=math.pi / 2 - heading))[rows.MAG : rows.MAG + 3]
    magnetic = math.atan2(-y, x)
    assert math.remainder(magnetic + place.DECLINATION - heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(math.atan2(z, math.hypot(x, y))) == pytest.approx(63.915)
    assert math.hypot(x, y, z) == pytest.approx(0.4897)


def test_field_at_a_tilted_body_is_the_same_vector():
    flat, tilted = (reading(at(roll=r, pitch=p, yaw=0.4))[rows.MAG : rows.MAG + 3] for r, p in ((0, 0), (0.5, -0.3)))
    assert np.linalg.norm(flat) == pytest.approx(np.linalg.norm(tilted))
    assert not np.allclose(flat, tilted, atol=0.05)


@pytest.mark.parametrize("height", [0.0, 2.0, 30.0, -5.0])
def test_barometer_gives_the_height_by_px4s_own_formula(height):
    pressure = 100.0 * reading(at((0.0, 0.0, height)))[rows.PRESSURE]
    lapse, gas, t0 = -0.0065, 287.1, 288.15
    altitude = ((pressure / 101325.0) ** (-lapse * gas / G) * t0 - t0) / lapse
    assert altitude == pytest.approx(489.4 + height, abs=1e-6)


def test_noise_and_biases_have_the_stated_size():
    noise, rng = SensorNoise(), stream(7)
    many = np.array([draw_errors(noise.row(), stream(i)) for i in range(400)])
    for index, sigma in ((rows.BIAS_ACCEL, 0.02), (rows.BIAS_GYRO, 0.002), (rows.BIAS_PRESSURE, 30.0)):
        assert many[:, index].std() == pytest.approx(sigma, rel=0.15)
    out, samples = np.zeros(rows.READING_LENGTH), []
    for _ in range(2000):
        sense(at(), NO_ERROR, noise.row(), rng, out)
        samples.append(out.copy())
    spread = np.array(samples).std(axis=0)
    assert spread[rows.ACCEL : rows.ACCEL + 3] == pytest.approx(noise.accelerometer, rel=0.1)
    assert spread[rows.GYRO : rows.GYRO + 3] == pytest.approx(noise.gyro, rel=0.1)
    assert spread[rows.MAG : rows.MAG + 3] == pytest.approx(noise.magnetometer, rel=0.1)
    assert 100.0 * spread[rows.PRESSURE] == pytest.approx(noise.barometer, rel=0.1)


def test_errors_lie_within_what_px4s_estimator_assumes():
    noise = SensorNoise()
    assert noise.accelerometer < 0.35, "EKF2_ACC_NOISE"
    assert noise.gyro < 0.015, "EKF2_GYR_NOISE"
    assert noise.magnetometer < 0.05, "EKF2_MAG_NOISE"
    assert noise.barometer / 11.3 < 3.5, "EKF2_BARO_NOISE, m"
    assert 3 * noise.accelerometer_bias < 0.4, "EKF2_ABL_LIM"
    assert 3 * noise.gyro_bias < 0.15, "EKF2_GYR_B_LIM"
    assert math.degrees(3 * noise.magnetometer_bias / (0.4897 * math.cos(math.radians(63.9)))) < 10.0


def test_gps_error_is_slow_and_its_velocity_white():
    noise, rng = SensorNoise(), stream(3)
    error, fix, row = draw_errors(noise.row(), stream(4)), np.zeros(6), at((1.0, 2.0, 3.0))
    fixes = []
    for _ in range(5000):
        sense_gps(row, error, noise.row(), rng, 0.1, fix)
        fixes.append(fix.copy())
    found = np.array(fixes) - (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    assert found[:, :3].std(axis=0) == pytest.approx(noise.gps, rel=0.3)
    assert np.diff(found[:, 0]).std() < 0.2 * noise.gps
    assert found[:, 3:].std(axis=0) == pytest.approx(noise.gps_velocity, rel=0.1)


@pytest.mark.parametrize("wrong", [{"gyro": -1.0}, {"gps": math.nan}, {"gps_tau": 0.0}])
def test_senseless_noise_is_refused(wrong):
    with pytest.raises(ValueError, match="sensor noise"):
        SensorNoise(**wrong).row()
