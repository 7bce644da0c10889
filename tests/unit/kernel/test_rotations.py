"""Quaternion kernels against numpy matrices and against each other."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel import rotations as rot

angle = st.floats(-3.1, 3.1)
number = st.floats(-10.0, 10.0)
rotation_vector = st.tuples(angle, angle, angle).filter(lambda v: 1e-3 < math.hypot(*v) < 3.1)
quaternion = rotation_vector.map(lambda v: rot.from_rotation_vector(*v))
NED_FROM_ENU = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_FROM_FRD = np.diag([1.0, -1, -1])


@given(quaternion, quaternion, number, number, number)
def test_a_product_rotates_by_the_right_factor_first(a, b, x, y, z):
    both = rot.rotate(rot.multiply(a, b), x, y, z)
    assert both == pytest.approx(rot.rotate(a, *rot.rotate(b, x, y, z)), abs=1e-9)
    assert rot.to_matrix(rot.multiply(a, b)) == pytest.approx(rot.to_matrix(a) @ rot.to_matrix(b), abs=1e-12)


@given(quaternion, number, number, number)
def test_rotate_agrees_with_the_matrix_and_rotate_back_undoes_it(q, x, y, z):
    turned = rot.rotate(q, x, y, z)
    assert turned == pytest.approx(rot.to_matrix(q) @ [x, y, z], abs=1e-9)
    assert rot.rotate_back(q, *turned) == pytest.approx((x, y, z), abs=1e-9)
    assert rot.body_z(q) == pytest.approx(rot.rotate(q, 0.0, 0.0, 1.0), abs=1e-12)


@given(st.tuples(*[st.floats(-0.115, 0.115)] * 3))
def test_a_small_rotation_vector_needs_no_sine(v):
    assert rot.from_small_rotation(*v) == pytest.approx(rot.from_rotation_vector(*v), abs=2e-15)


@given(quaternion)
def test_matrix_and_rotation_vector_round_trips(q):
    assert rot.angle_between(rot.from_matrix(rot.to_matrix(q)), q) < 1e-6
    assert rot.angle_between(rot.from_rotation_vector(*rot.to_rotation_vector(q)), q) < 1e-6


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns_round_trip_through_the_matrix(axis):
    q = [0.0, 0.0, 0.0, 0.0]
    q[axis + 1] = 1.0
    assert rot.angle_between(rot.from_matrix(rot.to_matrix(tuple(q))), tuple(q)) < 1e-6


@given(st.floats(1e-9, 0.05), st.sampled_from([(1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (0.0, -1.0, 0.0)]))
def test_the_small_angle_series_equals_the_closed_form(size, axis):
    q = rot.from_rotation_vector(*(size * a for a in axis))
    half = 0.5 * size
    assert q == pytest.approx((math.cos(half), *(math.sin(half) * a for a in axis)), abs=1e-13)


@given(angle, st.floats(-1.5, 1.5), angle)
def test_euler_angles_round_trip(roll, pitch, yaw):
    q = rot.from_euler(roll, pitch, yaw)
    assert rot.to_euler(q) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    assert rot.yaw(q) == pytest.approx(yaw, abs=1e-6)


def test_integrating_a_constant_rate_is_exact_in_any_number_of_steps():
    q = rot.IDENTITY
    for _ in range(1000):
        q = rot.integrate(q, 0.3, -0.8, 0.5, 0.002)
    assert q == pytest.approx(rot.from_rotation_vector(0.6, -1.6, 1.0), abs=1e-12)


@given(quaternion, number, number, number)
def test_ned_frd_is_the_same_rotation_seen_from_other_axes(q, x, y, z):
    swapped = rot.swap_attitude(q)
    assert rot.to_matrix(swapped) == pytest.approx(NED_FROM_ENU @ rot.to_matrix(q) @ FLU_FROM_FRD, abs=1e-12)
    assert rot.swap_attitude(swapped) == pytest.approx(q, abs=1e-12)
    assert rot.swap_world(x, y, z) == pytest.approx(NED_FROM_ENU @ [x, y, z])
    assert rot.swap_body(x, y, z) == pytest.approx(FLU_FROM_FRD.T @ [x, y, z])


@given(angle)
def test_heading_converts_between_frames_as_the_attitude_does(heading):
    ned = rot.yaw(rot.swap_attitude(rot.from_euler(0.0, 0.0, heading)))
    assert math.cos(ned - rot.swap_yaw(heading)) == pytest.approx(1.0)


def test_facing_north_is_heading_zero_and_the_identity_attitude_in_ned():
    assert rot.swap_yaw(math.pi / 2) == pytest.approx(0.0)
    assert rot.angle_between(rot.swap_attitude(rot.from_euler(0.0, 0.0, math.pi / 2)), rot.IDENTITY) < 1e-6


def test_a_zero_quaternion_becomes_the_identity():
    assert rot.normalise((0.0, 0.0, 0.0, 0.0)) == rot.IDENTITY


@given(st.floats(-100.0, 100.0))
def test_wrapped_angles_stay_in_half_open_range(a):
    wrapped = rot.wrap_angle(a)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped - a) == pytest.approx(1.0)
