import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hil.recording.foxglove import belief_orientation
from hil.report.recorded.geometry import (
    Motion,
    approach,
    at,
    axes,
    heading_deg,
    nose_up_deg,
    side_up_deg,
    specific_thrust,
)
from policies.task import result_row
from policies.task.contact import ContactRules, relative_state
from vehicle.quadrotor.airframe import load_airframe

QUATERNIONS = arrays(np.float64, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1)
ANGLES = st.floats(-3.0, 3.0)


def unit(q):
    return np.asarray(q) / np.linalg.norm(q)


def motion(position, orientation, velocity=(0.0, 0.0, 0.0), t=(0, 1_000_000_000)):
    n = len(t)
    return Motion(np.array(t), np.tile(position, (n, 1)), np.tile(velocity, (n, 1)), np.tile(orientation, (n, 1)))


@given(QUATERNIONS)
def test_axes_of_a_quaternion_are_a_rotation(q):
    R = axes(unit(q)[None])[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)


@given(ANGLES, st.floats(0.0, 1.4), QUATERNIONS, arrays(np.float64, 3, elements=st.floats(-2, 2)))
def test_approach_agrees_with_the_referee(heading, inclination, q, offset):
    q, centre, disc = unit(q), np.array([1.0, -2.0, 1.5]), load_airframe("paper_quad").contact
    out = np.zeros(result_row.DIM)
    board_row = np.array([*centre, heading, 0.0, 0.0, inclination, 0.0])
    relative_state(centre + offset, np.zeros(3), q, np.zeros(3), board_row, ContactRules().row(disc), out)
    board = motion(centre, belief_orientation(heading, inclination))
    seen = approach(motion(centre + offset, q), board, disc.magnet_below)
    assert seen.magnet[0, 0] == pytest.approx(out[result_row.X], abs=1e-9)
    assert seen.magnet[0, 1] == pytest.approx(out[result_row.Y], abs=1e-9)
    assert seen.normal_error[0] == pytest.approx(out[result_row.NORMAL_ERROR], abs=1e-6)
    lowest = seen.magnet[0, 2] - disc.footprint_radius * np.sin(seen.normal_error[0])
    assert lowest == pytest.approx(out[result_row.HEIGHT], abs=1e-6)


@given(ANGLES, st.floats(0.0, 1.5))
def test_the_boards_pitch_is_its_inclination(heading, inclination):
    assert nose_up_deg(np.array([belief_orientation(heading, inclination)]))[0] == pytest.approx(
        np.degrees(inclination)
    )


def test_interpolation_does_not_extrapolate_and_handles_quaternion_sign_flips():
    q = np.array([[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    p = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    between = at(Motion(np.array([0, 10, 20]), p, p, q), np.array([-1, 5, 15, 21]))
    np.testing.assert_allclose(between.position[:, 0], [np.nan, 0.5, 1.5, np.nan])
    np.testing.assert_allclose(np.abs(between.orientation[1:3, 0]), 1.0)


def test_thrust_is_one_g_in_hover_and_zero_in_free_fall():
    t = np.arange(0, 1_000_000_000, 4_000_000)
    hover = motion((0, 0, 2), (1, 0, 0, 0), t=t)
    assert np.nanmax(np.abs(specific_thrust(hover) - 9.80665)) < 1e-9
    fall = hover._replace(velocity=np.column_stack([0 * t, 0 * t, -9.80665 * t / 1e9]))
    assert np.nanmax(np.abs(specific_thrust(fall))) < 1e-6
    assert np.isnan(specific_thrust(hover)[0])


@given(ANGLES, st.floats(0.0, math.pi / 2))
def test_heading_and_roll_of_a_board_are_defined_up_to_a_wall(heading, inclination):
    board = np.tile(belief_orientation(heading, inclination), (2, 1))
    assert heading_deg(board) == pytest.approx(np.full(2, math.degrees(heading)), abs=1e-6)
    assert side_up_deg(board) == pytest.approx(np.zeros(2), abs=1e-6)


@given(st.floats(-1.5, 1.5))
def test_roll_of_a_level_body_is_its_sides_angle(roll):
    q = np.array([[math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0]])
    assert side_up_deg(q)[0] == pytest.approx(math.degrees(roll), abs=1e-6)
