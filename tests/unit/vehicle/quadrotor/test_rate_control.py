"""The body rate loop: against steps recorded from a real PX4, and its own rules (integrator, saturation, NaN)."""

import csv
import math
from collections import defaultdict

import numpy as np
import pytest

from kernel import rotations as rot
from kernel.random import stream, uniform
from tests.paths import PX4_DATA as DATA
from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor import dynamics as d
from vehicle.quadrotor import rate_control as rc

SIH = af.load_airframe("sih_quad").params_row()
PAPER = af.load_airframe("paper_quad").params_row()
AXES = {"roll": (0, 1.0), "pitch": (1, -1.0), "yaw": (2, -1.0)}  # FLU axis and sign of PX4's FRD rate
# rms bars, rad/s: what the model reaches (.030 .029 .026 .030 .012 .006 .020) plus a little.
BARS = {
    "roll 2.0": 0.032,
    "roll -2.0": 0.030,
    "roll 0.5": 0.027,
    "roll 6.0": 0.038,
    "pitch 2.0": 0.016,
    "yaw 1.0": 0.008,
    "yaw 3.0": 0.023,
}


def run_loop(row, setpoint, thrust, dt=0.002):
    rc.rate_step(d.column(row), 0, setpoint, thrust, d.column(PAPER), rc.filter_coefficients(PAPER, dt), dt)


def recorded_steps():
    steps = defaultdict(list)
    with (DATA / "rate_steps.csv").open() as file:
        for line in csv.DictReader(file):
            steps[line["step"]].append([float(v) for v in list(line.values())[1:]])
    return {name: np.array(rows) for name, rows in steps.items()}


def step_response_rms(name, substeps=1):
    """rms (rad/s) between model and recording; time zero is where PX4's own torque set-point jumps."""
    data = recorded_steps()[name]
    axis, sign = AXES[name.split()[0]]
    command = np.zeros(3)
    command[axis] = sign * data[0, 0]
    row = d.vehicle_row((0.0, 0.0, 100.0), motor=data[0, 1])
    row[state_row.W + axis] = sign * data[0, 3]
    rc.settle_filters(row, SIH, 0.004 / substeps)
    errors = []
    for _, thrust, _, measured in data:
        errors.append(sign * row[state_row.W + axis] - measured)
        for _ in range(2):
            rc.fly_normalised(row, *command, thrust, SIH, 0.004, substeps)
    return math.sqrt(np.mean(np.square(errors)))


@pytest.mark.parametrize("name", BARS)
def test_steps_follow_the_real_px4(name):
    assert step_response_rms(name) < BARS[name]


@pytest.mark.parametrize("name", ["roll 2.0", "pitch 2.0", "yaw 1.0"])
def test_rate_loop_agrees_with_px4_at_a_finer_step(name):
    assert step_response_rms(name, substeps=2) < 1.4 * BARS[name]


def recorded_thrust():
    thrust = defaultdict(list)
    with (DATA / "thrust_map.csv").open() as file:
        for line in csv.DictReader(file):
            thrust[float(line["thrust_cmd"])].append((float(line["t_s"]), float(line["thrust_accel_m_s2"])))
    return thrust


@pytest.mark.parametrize("command", [0.1, 0.2, 0.3, 0.4, 0.49, 0.5, 0.6, 0.7, 0.8, 0.9])
def test_thrust_follows_the_real_px4(command):
    row = d.vehicle_row((0.0, 0.0, 100.0), motor=SIH[airframe_row.HOVER_THRUST])
    per_kg = SIH[airframe_row.MOTOR_THRUST] / SIH[airframe_row.MASS]
    times, model = [], []
    for i in range(240):
        times.append(0.004 * i)
        model.append(per_kg * row[state_row.MOTOR : state_row.MOTOR + 4].sum())
        rc.fly_normalised(row, 0.0, 0.0, 0.0, command, SIH, 0.004, 1)
    samples = np.array(recorded_thrust()[command])
    late = samples[samples[:, 0] > 0.4]
    assert np.interp(late[:, 0], times, model) == pytest.approx(late[:, 1], abs=0.03)
    # The recording's command is logged up to two loop periods after it acted.
    errors = np.interp(samples[:, 0] + 0.008, times, model) - samples[:, 1]
    assert math.sqrt(np.mean(errors**2)) < 0.035 * max(1.0, abs(20.0 * command - af.GRAVITY))


@pytest.mark.parametrize("axis", [0, 1])
def test_the_paper_quadrotor_turns_within_forty_milliseconds(axis):
    row = d.vehicle_row((0.0, 0.0, 5.0), motor=PAPER[airframe_row.HOVER_THRUST])
    command = np.array([0.0, 0.0, 0.0, af.GRAVITY])
    command[axis] = 1.0
    rates = []
    for _ in range(300):
        rc.fly(row, command, PAPER, 0.002, 1)
        rates.append(row[state_row.W + axis])
    rise = 0.002 * (1 + int(np.argmax(np.array(rates) > 1 - math.exp(-1))))
    assert 0.030 < rise < 0.045
    assert max(rates) < 1.15
    assert rates[-1] == pytest.approx(1.0, abs=0.03)


def drawn_within_training_ranges(params, keys):
    """An airframe row with mass, inertia and thrust-to-weight drawn as in the paper's domain randomisation."""
    mass, inertia, thrust = uniform(keys, 0.7, 1.3), uniform(keys, 0.9, 1.1), uniform(keys, 0.85, 1.15)
    params[airframe_row.MASS] *= mass
    params[airframe_row.INERTIA : airframe_row.INERTIA + 3] *= inertia
    params[airframe_row.MOTOR_THRUST] *= mass * thrust
    return params


@pytest.mark.parametrize("seed", range(8))
def test_every_randomised_vehicle_is_stable_and_can_hover(seed):
    frame = af.load_airframe("paper_quad")
    params = drawn_within_training_ranges(frame.params_row(), stream(11, seed))
    row = d.vehicle_row((0.0, 0.0, 50.0), motor=params[airframe_row.HOVER_THRUST])
    row[state_row.W : state_row.W + 3] = (2.0, -2.0, 1.0)
    gain = (
        4
        * params[airframe_row.MOTOR_THRUST]
        * params[airframe_row.HOVER_THRUST]
        / (params[airframe_row.MASS] * af.GRAVITY)
    )
    assert 0.85 <= gain <= 1.15
    command = np.array([0.0, 0.0, 0.0, af.GRAVITY / gain])
    for _ in range(100):
        rc.fly(row, command, params, 0.01, 5)
    assert abs(row[state_row.W : state_row.W + 3]).max() < 0.05
    row[state_row.Q : state_row.Q + 4] = rot.IDENTITY
    row[state_row.V : state_row.V + 3] = 0.0
    for _ in range(50):
        rc.fly(row, command, params, 0.01, 5)
    assert abs(row[state_row.V + 2]) < 0.05


def test_commands_divide_by_the_nominal_hover_thrust():
    assert rc.normalised_thrust(af.GRAVITY, PAPER) == pytest.approx(1 / 2.26)
    assert rc.normalised_thrust(-1.0, PAPER) == 0.0
    assert rc.normalised_thrust(100.0, PAPER) == 1.0


def test_the_integrator_is_limited_and_does_not_wind_up_in_saturation():
    row = d.vehicle_row((0.0, 0.0, 100.0), motor=0.4)
    for _ in range(5000):  # the body never follows: nothing moves it
        run_loop(row, (1.0, 0.0, 0.0), 0.5)
    assert row[state_row.INTEGRAL] == pytest.approx(PAPER[airframe_row.RATE_LIMIT_I])
    row = d.vehicle_row((0.0, 0.0, 100.0), motor=0.0)
    for _ in range(5000):
        run_loop(row, (1.0, 0.0, 0.0), 0.0)  # no thrust, so no torque: saturated
    assert row[state_row.INTEGRAL] < 0.01


def test_a_nan_rate_keeps_the_present_rate():
    row = d.vehicle_row((0.0, 0.0, 100.0), motor=PAPER[airframe_row.HOVER_THRUST])
    row[state_row.W + 2] = 1.0
    rc.settle_filters(row, PAPER, 0.002)
    for _ in range(10):
        rc.fly_normalised(row, 0.0, 0.0, math.nan, PAPER[airframe_row.HOVER_THRUST], PAPER, 0.01, 5)
    assert row[state_row.W + 2] == pytest.approx(1.0, abs=0.1)
    assert np.isfinite(row).all()


def test_settled_filters_show_the_present_rate_at_once():
    row = d.vehicle_row()
    row[state_row.W : state_row.W + 3] = (1.0, -2.0, 0.5)
    rc.settle_filters(row, PAPER, 0.002)
    run_loop(row, (0.0, 0.0, 0.0), 0.4)
    assert row[state_row.RATE : state_row.RATE + 3] == pytest.approx([1.0, -2.0, 0.5])
    assert row[state_row.ACCEL : state_row.ACCEL + 3] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    rc.reset_rate_control(row)
    assert not row[state_row.GYRO : state_row.TORQUE_YAW + 1].any()


def test_two_runs_are_the_same_to_the_bit():
    ends = []
    for _ in range(2):
        row = d.vehicle_row((0.0, 0.0, 5.0), motor=0.4)
        for i in range(200):
            rc.fly(row, np.array([math.sin(i), 0.3, -0.2, 9.0]), PAPER, 0.01, 5)
        ends.append(row.tobytes())
    assert ends[0] == ends[1]
