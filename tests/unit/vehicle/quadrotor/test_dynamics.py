"""The rigid body and its motors: known motions, conservation, convergence."""

import math

import numpy as np
import pytest

from kernel import rotations as rot
from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor import dynamics as d

PAPER = af.load_airframe("paper_quad").params_row()
DT = 0.002


def free_of_air(params=PAPER):
    row = params.copy()
    row[airframe_row.DRAG : airframe_row.DRAG + 3] = 0.0
    row[airframe_row.ANGULAR_DAMPING] = 0.0
    return row


def run(row, motors, params, seconds, dt=DT):
    for _ in range(round(seconds / dt)):
        d.vehicle_step(d.column(row), 0, motors, d.column(params), d.motor_lag(params, dt), dt)
    return row


def test_vehicle_without_thrust_falls_at_g():
    row = run(d.vehicle_row((0.0, 0.0, 10.0)), (0.0,) * 4, free_of_air(), 1.0)
    assert row[state_row.P : state_row.P + 3] == pytest.approx([0.0, 0.0, 10.0 - 0.5 * af.GRAVITY], abs=1e-9)
    assert row[state_row.F : state_row.F + 3] == pytest.approx([0.0, 0.0, 0.0])


def test_hover_command_keeps_altitude():
    hover = PAPER[airframe_row.HOVER_THRUST]
    row = run(d.vehicle_row((1.0, 2.0, 3.0), motor=hover), (hover,) * 4, PAPER, 2.0)
    assert row[state_row.P : state_row.V + 3] == pytest.approx([1.0, 2.0, 3.0, 0.0, 0.0, 0.0], abs=1e-9)
    assert row[state_row.F + 2] == pytest.approx(af.GRAVITY)


def test_motors_lag_first_order():
    row = d.vehicle_row()
    run(row, (1.0,) * 4, PAPER, PAPER[airframe_row.MOTOR_LAG], dt=PAPER[airframe_row.MOTOR_LAG] / 10)
    assert row[state_row.MOTOR : state_row.MOTOR + 4] == pytest.approx([1 - math.exp(-1)] * 4)


def test_drag_accelerates_the_vehicle_to_the_wind_speed():
    row = d.vehicle_row(motor=PAPER[airframe_row.HOVER_THRUST])
    row[state_row.WIND : state_row.WIND + 3] = (3.0, -2.0, 0.0)
    run(row, (PAPER[airframe_row.HOVER_THRUST],) * 4, PAPER, 60.0)
    assert row[state_row.V : state_row.V + 3] == pytest.approx([3.0, -2.0, 0.0], abs=1e-3)


@pytest.mark.parametrize(
    ("motors", "axis", "sign"),
    [((0.4, 0.5, 0.5, 0.4), 0, 1), ((0.4, 0.5, 0.4, 0.5), 1, 1), ((0.4, 0.4, 0.5, 0.5), 2, 1)],
)
def test_motor_torques_follow_the_motor_numbers_of_px4(motors, axis, sign):
    row = run(d.vehicle_row(motor=0.45), motors, PAPER, 0.1)
    rates = row[state_row.W : state_row.W + 3]
    assert sign * rates[axis] > 0.05
    assert np.delete(rates, axis) == pytest.approx([0.0, 0.0], abs=1e-3)


def test_angular_momentum_is_kept_in_free_rotation():
    params = free_of_air()
    row = d.vehicle_row()
    row[state_row.W : state_row.W + 3] = (3.0, -2.0, 4.0)
    inertia = params[airframe_row.INERTIA : airframe_row.INERTIA + 3]

    def momentum():
        return np.array(rot.rotate(row[state_row.Q : state_row.Q + 4], *(inertia * row[state_row.W : state_row.W + 3])))

    before = momentum()
    run(row, (0.0,) * 4, params, 1.0)
    assert momentum() == pytest.approx(before, rel=0.02)
    assert np.linalg.norm(row[state_row.Q : state_row.Q + 4]) == pytest.approx(1.0, abs=1e-12)


def test_halving_the_step_changes_little():
    ends = []
    for dt in (0.004, 0.002, 0.001):
        row = d.vehicle_row(motor=0.45)
        row[state_row.W : state_row.W + 3] = (1.0, 0.5, -0.5)
        ends.append(run(row, (0.50, 0.52, 0.51, 0.49), PAPER, 0.5, dt)[state_row.P : state_row.Q + 4].copy())
    coarse, fine = abs(ends[0] - ends[1]).max(), abs(ends[1] - ends[2]).max()
    assert fine < 2e-3 and fine < 0.7 * coarse
