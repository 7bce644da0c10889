"""Motion capture's noise: as stated, without bias, and the same again for the same seed."""

import math

import numpy as np
import pytest

from kernel.rotations import angle_between, conjugate, from_euler, multiply, to_rotation_vector
from vehicle.mocap.system import Mocap, MocapNoise

STATE = ((1.0, -2.0, 3.0), (0.5, 0.0, -0.5), from_euler(0.3, -0.4, 2.0), (0.1, 0.2, -0.3))


def samples(count, seed=3, noise=None):
    mocap = Mocap(seed, noise)
    return [mocap.measure(*STATE) for _ in range(count)]


def test_noise_is_as_stated_and_unbiased():
    noise, count = MocapNoise(), 4000
    seen = samples(count)
    for part, sigma in ((0, noise.position), (1, noise.velocity), (3, noise.body_rate)):
        error = np.array([sample[part] for sample in seen]) - STATE[part]
        assert error.std(axis=0) == pytest.approx([sigma] * 3, rel=0.05)
        assert abs(error.mean(axis=0)).max() < 4 * sigma / math.sqrt(count)
    turns = np.array([to_rotation_vector(multiply(conjugate(STATE[2]), sample[2])) for sample in seen])
    assert turns.std(axis=0) == pytest.approx([noise.orientation] * 3, rel=0.05)
    assert abs(turns.mean(axis=0)).max() < 4 * noise.orientation / math.sqrt(count)


def test_mocap_noise_is_that_of_a_real_system():
    seen = samples(200)
    assert max(math.dist(sample[0], STATE[0]) for sample in seen) < 0.002
    assert max(angle_between(sample[2], STATE[2]) for sample in seen) < math.radians(0.4)
    assert all(math.hypot(*sample[2]) == pytest.approx(1.0) for sample in seen)


def test_equal_seeds_measure_equally_and_others_do_not():
    assert samples(5, seed=1) == samples(5, seed=1)
    assert samples(5, seed=1) != samples(5, seed=2)


def test_mocap_without_noise_measures_the_truth():
    (seen,) = samples(1, noise=MocapNoise(0.0, 0.0, 0.0, 0.0))
    assert seen[:2] == STATE[:2] and seen[3] == STATE[3]
    assert seen[2] == pytest.approx(STATE[2])
