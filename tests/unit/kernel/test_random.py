import math

import numpy as np
import pytest

from kernel.jit import njit, prange
from kernel.random import next_uint64, normal, stream, uniform


def test_splitmix64_reference_numbers():
    # the published reference sequence of SplitMix64 for seed 1234567
    state = np.array([1234567], np.uint64)
    expected = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    assert [int(next_uint64(state)) for _ in range(5)] == expected


def test_equal_keys_give_equal_streams_and_order_of_keys_matters():
    assert stream(1, 2, 3) == stream(1, 2, 3)
    assert len({int(stream(*k)[0]) for k in [(1, 2), (2, 1), (1,), (2,)]}) == 4


def test_negative_and_large_keys_are_allowed():
    assert stream(-1) != stream(1)
    assert stream(2**63 - 1).shape == (1,)


def test_uniform_stays_in_range_and_is_flat():
    state = stream(5)
    draws = np.array([uniform(state, -2.0, 3.0) for _ in range(20000)])
    assert draws.min() >= -2.0
    assert draws.max() < 3.0
    counts, _ = np.histogram(draws, bins=20, range=(-2.0, 3.0))
    assert ((counts - 1000) ** 2 / 1000).sum() < 43.8  # chi-square, 19 degrees of freedom, p = 0.001


def test_normal_has_the_moments_of_a_normal():
    state = stream(6)
    draws = np.array([normal(state) for _ in range(40000)])
    assert abs(draws.mean()) < 4 / math.sqrt(40000)
    assert draws.var() == pytest.approx(1.0, abs=0.03)
    assert (draws**4).mean() == pytest.approx(3.0, abs=0.25)
    assert np.isfinite(draws).all()


@njit(parallel=True)
def _rows(states, out):
    for i in prange(states.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = normal(states[i])


def test_parallel_rollout_draws_the_numbers_of_a_serial_one():
    states = np.concatenate([stream(9, i) for i in range(8)]).reshape(8, 1)
    out = np.empty((8, 50))
    _rows(states, out)
    for i in range(8):
        own = stream(9, i)
        assert [normal(own) for _ in range(50)] == list(out[i])
