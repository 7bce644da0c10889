"""Airframe files: published figures, required keys and error messages."""

import numpy as np
import pytest

from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor import dynamics as d
from vehicle.quadrotor.rate_control import fly, settle_filters

GOOD = """
title = "t"
[body]
mass = 1.0
inertia = [0.01, 0.01, 0.02]
[motors]
thrust_to_weight = 2.0
lag = 0.03
arm_x = 0.1
arm_y = 0.1
yaw_torque = 0.01
[rate_control]
p = [0.1, 0.1, 0.1]
i = [0.1, 0.1, 0.1]
d = [0.0, 0.0, 0.0]
[command]
thrust = [5.0, 15.0]
body_rate = 3.0
rate_lag = 0.05
[contact]
magnet_below = 0.04
footprint_radius = 0.1
"""


def test_the_published_figures_are_in_the_files():
    paper = af.load_airframe("paper_quad")
    assert (paper.body.mass, paper.motors.thrust_to_weight, paper.camera.tilt_deg) == (0.6102, 2.26, 15.0)
    assert (paper.contact.magnet_below, paper.contact.footprint_radius) == (0.04, 0.13)
    crazyflie = af.load_airframe("crazyflie")
    assert (crazyflie.body.mass, crazyflie.motors.thrust_to_weight) == (0.0311, 1.53)


@pytest.mark.parametrize("name", af.list_airframes())
def test_hover_command_carries_the_nominal_weight(name):
    frame = af.load_airframe(name)
    row = frame.params_row()
    assert row.shape == (airframe_row.DIM,) and row.dtype == np.float64
    assert 4 * row[airframe_row.MOTOR_THRUST] * row[airframe_row.HOVER_THRUST] == pytest.approx(
        row[airframe_row.MASS] * af.GRAVITY
    )


def test_sih_airframe_agrees_with_the_measured_vehicle():
    row = af.load_airframe("sih_quad").params_row()
    assert row[airframe_row.MOTOR_THRUST] == pytest.approx(5.0, rel=1e-6)
    assert row[airframe_row.MOTOR_THRUST] * row[airframe_row.YAW_TORQUE] == pytest.approx(0.1, rel=1e-6)


def test_own_airframe_file_is_read_and_named_after_its_file(tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD)
    assert af.load_airframe(tmp_path / "mine.toml").name == "mine"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("mass = 1.0", "mass = -1.0"), "body.mass"),
        (("mass = 1.0", "mass = nan"), "body.mass"),
        (("mass = 1.0", "weight = 1.0"), "body.weight"),
        (("thrust_to_weight = 2.0", "thrust_to_weight = 0.9"), "motors.thrust_to_weight"),
        (("[contact]\nmagnet_below = 0.04\nfootprint_radius = 0.1\n", ""), 'key "contact" is missing'),
        (("[command]\nthrust = [5.0, 15.0]\nbody_rate = 3.0\nrate_lag = 0.05\n", ""), 'key "command" is missing'),
        (("thrust = [5.0, 15.0]", "thrust = [10.0, 15.0]"), "gravity"),
        (("thrust = [5.0, 15.0]", "thrust = [5.0, 20.0]"), "the motors give 19.61"),
        (("[0.01, 0.01, 0.02]", "[0.01, 0.01, 0.03]"), "inertia"),
        (("p = [0.1, 0.1, 0.1]", "p = [0.1, 0.1]"), "rate_control.p"),
        (("magnet_below = 0.04\n", ""), "contact.magnet_below"),
        (('title = "t"', 'title = "t'), "not valid TOML"),
    ],
)
def test_errors_name_file_and_key(tmp_path, change, message):
    path = tmp_path / "broken.toml"
    path.write_text(GOOD.replace(*change))
    with pytest.raises(ValueError, match=r"broken\.toml") as error:
        af.load_airframe(path)
    assert message in str(error.value)


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(ValueError, match="paper_quad"):
        af.load_airframe("paper_qaud")
    with pytest.raises(ValueError, match=r"nowhere\.toml: cannot be read"):
        af.load_airframe("nowhere.toml")


@pytest.mark.parametrize("name", af.list_airframes())
@pytest.mark.parametrize("axis", [0, 1])
def test_rate_lag_is_that_of_the_model(name, axis):
    frame, dt = af.load_airframe(name), 0.002
    params, command = frame.params_row(), np.array([0.0, 0.0, 0.0, af.GRAVITY])
    row = d.vehicle_row((0.0, 0.0, 5.0), motor=frame.hover_thrust)
    settle_filters(row, params, dt)
    command[axis], elapsed = 1.0, 0.0
    while row[state_row.W + axis] < 1.0 - np.exp(-1.0):
        fly(row, command, params, dt, 1)
        elapsed += dt
    assert elapsed == pytest.approx(frame.command.rate_lag, rel=0.1)
