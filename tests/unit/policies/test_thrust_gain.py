import math

import numpy as np
import pytest

from kernel.random import normal, stream
from policies import thrust_gain as tg
from vehicle.airframe import DRAG, MASS, MOTOR_LAG, MOTOR_THRUST, load_airframe
from vehicle.dynamics import Q, V, vehicle_row
from vehicle.rate_control import fly
from vehicle.rotations import body_z

G = 9.80665


def fly_and_estimate(gain, noise=0.0, seconds=1.5):
    """Estimates after each tick while the real vehicle model flies about with a wrong thrust."""
    airframe = load_airframe("paper_quad")
    params = airframe.params_row()
    params[MOTOR_THRUST] *= gain
    row, state, rng = vehicle_row((0, 0, 5), motor=airframe.hover_thrust), np.zeros(tg.GAIN_DIM), stream(3)
    tg.gain_reset(state, G)
    drag = params[DRAG] / params[MASS]
    out = []
    for k in range(int(seconds * 100)):
        command = np.array([0.6 * math.sin(0.1 * k), 0.8 * math.cos(0.13 * k), 0.0, 10.0 + 2.0 * math.sin(0.2 * k)])
        fly(row, command, params, 0.01, 5)
        v = row[V : V + 3] + noise * np.array([normal(rng) for _ in range(3)])
        z = body_z(row[Q : Q + 4])
        out.append(tg.gain_update(state, *v, *z, command[3], 0.01, params[MOTOR_LAG], drag, G))
    return np.array(out)


@pytest.mark.parametrize("gain", [0.85, 0.95, 1.0, 1.15])
def test_the_gain_is_known_within_a_few_tenths_of_a_second(gain):
    estimates = fly_and_estimate(gain)
    assert abs(estimates[40:] - gain).max() < 0.025
    assert abs(estimates[100:] - gain).max() < 0.015


def test_odometry_noise_leaves_it_usable():
    assert abs(fly_and_estimate(0.9, noise=0.02)[60:] - 0.9).max() < 0.05


def test_a_tick_that_is_not_finite_or_has_no_duration_changes_nothing():
    state = np.zeros(tg.GAIN_DIM)
    tg.gain_reset(state, G)
    for _ in range(50):
        tg.gain_update(state, 0, 0, 0, 0, 0, 1, 1.1 * G, 0.01, 0.04, 0.2, G)
    before = state.copy()
    assert tg.gain_update(state, math.nan, 0, 0, 0, 0, 1, G, 0.01, 0.04, 0.2, G) == before[tg.G_GAIN]
    assert tg.gain_update(state, 1, 0, 0, 0, 0, 1, G, 0.0, 0.04, 0.2, G) == before[tg.G_GAIN]
    assert np.array_equal(before, state)
    assert before[tg.G_GAIN] == pytest.approx(1 / 1.1, abs=0.01)
