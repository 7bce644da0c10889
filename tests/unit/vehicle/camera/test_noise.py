import math

import numpy as np
import pytest

from kernel.random import stream
from vehicle.camera import bias_row, detection_row, noise_row
from vehicle.camera import noise as n
from vehicle.camera.pinhole import Camera, optical_from_world, world_from_optical

CAM = Camera(offset=(0.0, 0.0, 0.0)).row()
PAPER = n.paper_noise()
NO_BIAS = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
VEHICLE_Q = np.array([math.cos(0.4), 0.0, 0.0, math.sin(0.4)])


def scene(distance=3.0, off_axis=0.2):
    """A board with normal straight up, `distance` from the camera, `off_axis` rad beside the optical axis."""
    direction = np.array(world_from_optical(VEHICLE_Q, math.sin(off_axis), 0.0, math.cos(off_axis), CAM))
    return distance * direction, np.array([1.0, 0.0, 0.0, 0.0]), direction


def observe_many(count, noise=PAPER, scale=1.0, bias=NO_BIAS, speed=2.0):
    p, q, direction = scene()
    rng, out = stream(7, 1), np.zeros((count, detection_row.DIM))
    velocity = np.array([speed, 0.0, 0.0])
    for i in range(count):
        n.observe_board(np.zeros(3), VEHICLE_Q, velocity, p, q, np.zeros(3), CAM, noise, scale, bias, rng, out[i])
    return p, q, direction, out


def test_noise_scaling_agrees_with_the_formula_of_the_paper():
    p, _, direction = scene()
    d, ca, ci, v = n.viewing_condition(
        np.zeros(3), VEHICLE_Q, np.array([2.0, 0.0, 0.0]), p, 0.0, 0.0, 1.0, np.array([0.0, 1.0, 0.0]), CAM
    )
    assert (d, ca, ci, v) == pytest.approx((3.0, math.cos(0.2), -direction[2], math.sqrt(5.0)))
    s_f = math.sqrt(1.0 * d) * (1 + 2 * (1 - ca)) * (1 + 2 * (1 - ci)) * (1 + 0.15 * v)
    expected = (0.021 * s_f, 0.028 * s_f, math.radians(2.0) * s_f)
    assert n.predicted_sigmas(d, ca, ci, v, PAPER, 1.0) == pytest.approx(expected)
    assert n.predicted_sigmas(d, ca, ci, v, PAPER, 0.1) == pytest.approx([0.1 * e for e in expected])


def test_position_noise_has_its_predicted_moments_in_the_optical_frame():
    p, _, _, out = observe_many(6000)
    errors = np.array([optical_from_world(VEHICLE_Q, *e, CAM) for e in out[:, :3] - p])
    lateral, depth = out[0, detection_row.SIGMA_LATERAL], out[0, detection_row.SIGMA_DEPTH]
    assert np.allclose(errors.std(axis=0), [lateral, lateral, depth], rtol=0.03)
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * errors.std(axis=0) / math.sqrt(len(errors)))
    correlation = np.corrcoef(errors.T) - np.eye(3)
    assert np.abs(correlation).max() < 0.05
    assert depth / lateral == pytest.approx(0.028 / 0.021)


def test_rotation_noise_is_a_gaussian_angle_about_a_uniform_axis():
    _, _, _, out = observe_many(6000)
    angle = 2 * np.arctan2(np.linalg.norm(out[:, 4:7], axis=1), np.abs(out[:, 3]))
    sigma = out[0, detection_row.SIGMA_ROTATION]
    assert math.sqrt(np.mean(angle**2)) == pytest.approx(sigma, rel=0.03)
    assert np.mean(angle) == pytest.approx(sigma * math.sqrt(2 / math.pi), rel=0.03)  # half-normal
    axis = out[:, 4:7] / np.linalg.norm(out[:, 4:7], axis=1)[:, None]
    assert np.allclose(np.mean(axis**2, axis=0), 1 / 3, atol=0.02)
    assert np.allclose(np.linalg.norm(out[:, 3:7], axis=1), 1.0)


def test_camera_without_noise_measures_truth_plus_bias():
    p, q, _, out = observe_many(1, scale=0.0)
    assert np.allclose(out[0, :3], p)
    assert np.allclose(out[0, 3:7], q)
    bias = np.array([0.01, -0.02, 0.03, math.cos(0.05), 0.0, math.sin(0.05), 0.0])
    _, _, _, out = observe_many(1, scale=0.0, bias=bias)
    assert np.allclose(out[0, :3], p + bias[:3])
    assert np.allclose(out[0, 3:7], bias[3:])


def test_camera_bias_has_its_configured_moments():
    rng, bias = stream(3), np.zeros(bias_row.DIM)
    rows = []
    for _ in range(4000):
        n.draw_bias(PAPER, 1.0, rng, bias)
        rows.append(bias.copy())
    rows = np.array(rows)
    assert np.allclose(rows[:, :3].std(axis=0), 0.02, rtol=0.05)
    angle = 2 * np.arctan2(np.linalg.norm(rows[:, 4:], axis=1), np.abs(rows[:, 3]))
    assert math.sqrt(np.mean(angle**2)) == pytest.approx(math.radians(2.0), rel=0.05)


def test_equal_streams_give_equal_observations():
    assert np.array_equal(observe_many(5)[3], observe_many(5)[3])


def test_measured_noise_is_far_below_the_papers_and_has_no_bias():
    condition = (2.0, 0.98, 0.7, 1.0)
    measured = n.predicted_sigmas(*condition, n.measured_noise(), 1.0)
    paper = n.predicted_sigmas(*condition, PAPER, 1.0)
    assert all(0.0 < m < 0.1 * p for m, p in zip(measured, paper, strict=True))
    bias = np.zeros(bias_row.DIM)
    n.draw_bias(n.measured_noise(), 1.0, stream(1), bias)
    assert np.array_equal(bias, NO_BIAS)


def test_rows_have_their_documented_length():
    assert PAPER.shape == n.measured_noise().shape == (noise_row.DIM,)
    with pytest.raises(IndexError):
        PAPER[noise_row.DIM]
