import math
import random

import numpy as np
import pytest

from kernel.rotations import body_z, from_euler, integrate, rotate
from vehicle.px4.driver.braking import braking_rates
from vehicle.px4.driver.types import Odometry
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY, load_airframe
from vehicle.quadrotor.dynamics import vehicle_row
from vehicle.quadrotor.rate_control import fly

AIRFRAME = load_airframe("paper_quad")
HOVER = AIRFRAME.hover_thrust
MOST = 0.8 * 9.80665 / HOVER
STILL = (0.0, 0.0, 0.0)


def asked(velocity=STILL, orientation=(1.0, 0.0, 0.0, 0.0), hover=HOVER):
    rates = braking_rates(0, Odometry(0, STILL, velocity, orientation, STILL), hover)
    assert rates is not None
    return rates


def test_vehicle_that_stands_is_held_level_at_its_weight():
    assert asked() == ((0.0, 0.0, 0.0), pytest.approx(GRAVITY, abs=1e-2))


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.0, -2.0])
def test_net_acceleration_points_against_the_velocity(heading):
    draws = random.Random(2)
    for _ in range(50):
        velocity = tuple(draws.choice((-1.0, 1.0)) * draws.uniform(3.0, 6.0) for _ in range(3))
        q = from_euler(0.0, 0.0, heading)
        for _ in range(400):  # turned as asked, until no turn is left
            (p, r, y), thrust = asked(velocity, q)
            assert y == 0.0 and math.hypot(p, r) <= 3.5 + 1e-9
            q = integrate(q, p, r, y, 0.01)
        net = thrust * np.array(body_z(q)) - (0.0, 0.0, 9.80665)
        assert thrust == pytest.approx(MOST, rel=1e-6)
        assert float(net @ velocity) == pytest.approx(-np.linalg.norm(net) * math.hypot(*velocity), rel=1e-4)


@pytest.mark.parametrize(("pitch_deg", "seconds", "metres"), [(0.0, 0.6, 1.4), (25.0, 0.8, 2.2), (60.0, 1.1, 3.8)])
def test_vehicle_at_4_m_s_stops_soon_and_ends_level_however_it_is_pitched_forward(pitch_deg, seconds, metres):
    row = vehicle_row(STILL, from_euler(0.0, math.radians(pitch_deg), 0.5), HOVER)
    row[state_row.V : state_row.V + 3] = rotate(from_euler(0.0, 0.0, 0.5), 4.0, 0.0, -1.0)
    params, slow = AIRFRAME.params_row(), None
    for k in range(150):
        q = tuple(float(x) for x in row[state_row.Q : state_row.Q + 4])
        velocity = tuple(float(x) for x in row[state_row.V : state_row.V + 3])
        rates = asked(velocity, q)
        fly(row, np.array([*rates.body_rate, rates.thrust]), params, 0.01, 5)
        if slow is None and math.hypot(*row[state_row.V : state_row.V + 3]) < 0.5:
            slow = k * 0.01, float(np.linalg.norm(row[:3])), body_z(tuple(row[state_row.Q : state_row.Q + 4]))[2]
    assert slow is not None
    assert slow[0] < seconds and slow[1] < metres, slow
    assert slow[2] > 0.75
    assert np.linalg.norm(row[state_row.V : state_row.V + 3]) < 0.2


@pytest.mark.parametrize("hover", [0.05, 0.442, 0.79, 0.95])
def test_every_airframe_and_attitude_gets_a_finite_command(hover):
    draws = random.Random(3)
    for _ in range(200):
        q = from_euler(*(draws.uniform(-math.pi, math.pi) for _ in range(3)))
        rates = asked(tuple(draws.choice((0.0, 1e-9, draws.uniform(-20, 20))) for _ in range(3)), q, hover)
        assert all(map(math.isfinite, (*rates.body_rate, rates.thrust))) and rates.thrust > 0.0


@pytest.mark.parametrize(
    "odometry",
    [
        None,
        Odometry(-101_000_000, STILL, STILL, (1.0, 0.0, 0.0, 0.0), STILL),
        Odometry(0, STILL, (math.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), STILL),
        Odometry(0, STILL, STILL, (math.inf, 0.0, 0.0, 0.0), STILL),
    ],
)
def test_nothing_is_asked_without_usable_odometry(odometry):
    assert braking_rates(0, odometry, HOVER) is None
