from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.estimation import odometry_row
from policies.estimation.odometry import odometry_now
from vehicle.quadrotor.airframe import GRAVITY

RATE = st.tuples(*[st.floats(-3.5, 3.5)] * 3)
VELOCITY = st.tuples(*[st.floats(-6.0, 6.0)] * 3)
TURN = st.tuples(*[st.floats(-1.2, 1.2)] * 3)


@dataclass
class View:
    position: tuple
    velocity: tuple
    orientation: tuple
    body_rate: tuple
    stamp_ns: int = 1_000_000_000


def now(view, age, thrust=GRAVITY, drag=0.2):
    at = view.stamp_ns + round(age * 1e9)
    return [part.copy() for part in odometry_now(at, view, thrust, drag, np.zeros(odometry_row.DIM))]


@settings(max_examples=40, deadline=None)
@given(VELOCITY, TURN, RATE, st.floats(5.0, 15.0), st.floats(0.0, 0.02))
def test_agrees_with_the_motion_integrated_finely(velocity, turn, rate, thrust, age):
    view = View((1.0, -2.0, 3.0), velocity, from_rotation_vector(*turn), rate)
    p, v, q = np.array(view.position), np.array(velocity), view.orientation
    steps = 200
    dt = age / steps
    for _ in range(steps):
        a = thrust * np.array(body_z(q)) - 0.2 * v - np.array([0.0, 0.0, GRAVITY])
        p, v = p + dt * v + 0.5 * dt * dt * a, v + dt * a
        q = multiply(q, from_rotation_vector(*(dt * w for w in rate)))
    there, speed, orientation = now(view, age, thrust)
    assert there == pytest.approx(p, abs=2e-4)
    assert speed == pytest.approx(v, abs=4e-3)
    assert orientation == pytest.approx(np.array(q), abs=1e-9)


def test_odometry_of_age_zero_is_unchanged():
    view = View((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    position, velocity, orientation = now(view, 0.0)
    assert (tuple(position), tuple(velocity), tuple(orientation)) == (view.position, view.velocity, view.orientation)


def test_prediction_reduces_the_error_in_a_flare():
    """Nose-up by 60 deg at 12 m/s^2, 16 ms old: the speed left is 0.17 m/s less than the estimate."""
    view = View((0.0, 0.0, 2.0), (5.0, 0.0, 0.0), from_rotation_vector(0.0, -np.pi / 3, 0.0), (0.0, 0.0, 0.0))
    _, velocity, _ = now(view, 0.016, 12.0, 0.0)
    assert velocity[0] == pytest.approx(5.0 - 0.016 * 12.0 * np.sin(np.pi / 3))
