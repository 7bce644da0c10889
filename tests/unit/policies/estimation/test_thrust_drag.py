import math

import numpy as np
import pytest

from kernel.random import normal, stream
from kernel.rotations import body_z
from policies.estimation import thrust_drag as tg
from policies.estimation import thrust_row
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor.airframe import load_airframe
from vehicle.quadrotor.dynamics import vehicle_row
from vehicle.quadrotor.rate_control import fly

G = 9.80665


def fly_and_estimate(gain, noise=0.0, seconds=1.5, drag=1.0, speed=0.0):
    """Gains and drags after each tick while the real vehicle model flies about with a wrong thrust and drag."""
    airframe = load_airframe("paper_quad")
    params = airframe.params_row()
    usual = params[airframe_row.DRAG] / params[airframe_row.MASS]
    params[airframe_row.MOTOR_THRUST] *= gain
    params[airframe_row.DRAG : airframe_row.DRAG + 3] = drag * params[airframe_row.DRAG]
    row, state, rng = vehicle_row((0, 0, 5), motor=airframe.hover_thrust), np.zeros(thrust_row.DIM), stream(3)
    row[state_row.V] = speed
    tg.gain_reset(state, G)
    out = []
    for k in range(int(seconds * 100)):
        command = np.array([0.6 * math.sin(0.1 * k), 0.8 * math.cos(0.13 * k), 0.0, 10.0 + 2.0 * math.sin(0.2 * k)])
        fly(row, command, params, 0.01, 5)
        v = row[state_row.V : state_row.V + 3] + noise * np.array([normal(rng) for _ in range(3)])
        z = body_z(row[state_row.Q : state_row.Q + 4])
        found = tg.gain_update(state, *v, *z, command[3], 0.01, params[airframe_row.MOTOR_LAG], usual, G)
        out.append((found, state[thrust_row.DRAG]))
    return np.array(out).T


@pytest.mark.parametrize("gain", [0.85, 0.95, 1.0, 1.15])
def test_thrust_gain_converges_within_a_few_tenths_of_a_second(gain):
    estimates, _ = fly_and_estimate(gain)
    assert abs(estimates[40:] - gain).max() < 0.025
    assert abs(estimates[100:] - gain).max() < 0.015


def test_thrust_gain_is_usable_with_odometry_noise():
    assert abs(fly_and_estimate(0.9, noise=0.02)[0][60:] - 0.9).max() < 0.05


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.0, 2.5])
def test_drag_converges_after_two_seconds_of_motion(factor):
    _, found = fly_and_estimate(0.9, noise=0.02, seconds=3.0, drag=factor, speed=2.5)
    nominal = load_airframe("paper_quad").params_row()
    usual = nominal[airframe_row.DRAG] / nominal[airframe_row.MASS]
    assert found[0] == pytest.approx(usual)
    assert abs(found[200:] - factor * usual).max() < 0.06


def test_non_finite_or_zero_duration_tick_does_not_change_the_estimate():
    state = np.zeros(thrust_row.DIM)
    tg.gain_reset(state, G)
    for _ in range(50):
        tg.gain_update(state, 0, 0, 0, 0, 0, 1, 1.1 * G, 0.01, 0.04, 0.2, G)
    before = state.copy()
    assert tg.gain_update(state, math.nan, 0, 0, 0, 0, 1, G, 0.01, 0.04, 0.2, G) == before[thrust_row.GAIN]
    assert tg.gain_update(state, 1, 0, 0, 0, 0, 1, G, 0.0, 0.04, 0.2, G) == before[thrust_row.GAIN]
    assert np.array_equal(before, state)
    assert before[thrust_row.GAIN] == pytest.approx(1 / 1.1, abs=0.01)
