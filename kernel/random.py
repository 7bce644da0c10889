"""A random stream that is one uint64 in an array: the same numbers in any thread, in training and in flight.

The generator is SplitMix64 (Steele, Lea, Flood 2014). Numba's own `np.random` state is per thread, which would make a
parallel rollout depend on scheduling.
"""

import numpy as np

from kernel.jit import njit


def stream(*key: int) -> np.ndarray:
    """A stream (shape (1,), uint64) for an integer key such as (seed, node, episode); equal keys give equal streams.

    SeedSequence ignores trailing zeros and splits large numbers, so every part takes two words and the length one.
    """
    words = [word for part in key for word in (part & 0xFFFFFFFF, part >> 32 & 0xFFFFFFFF)]
    return np.random.SeedSequence([*words, len(key) + 1]).generate_state(1, np.uint64)


@njit
def next_uint64(state):
    """Advance `state` ((1,) uint64) and return 64 random bits."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit
def uniform(state, low, high):
    """One draw from U(low, high)."""
    return low + (high - low) * (np.float64(next_uint64(state) >> np.uint64(11)) * (1.0 / 9007199254740992.0))


@njit
def normal(state):
    """One draw from N(0, 1) (Box-Muller, one of the pair is dropped to keep the state one word)."""
    u = uniform(state, 1e-300, 1.0)
    return np.sqrt(-2.0 * np.log(u)) * np.cos(6.283185307179586 * uniform(state, 0.0, 1.0))
