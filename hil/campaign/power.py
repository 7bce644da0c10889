"""How many flights a difference takes, and the smallest difference that so many flights can show. Exact, by scipy."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import special
from scipy.stats import binom

MOST = 100_000  # flights


def detectable(flights: int, rate: float, confidence: float = 0.95, power: float = 0.8) -> float | None:
    """The smallest d for which a policy with the true rate `rate - d` is shown to be below `rate` with probability
    `power`, by the exact one-sided binomial test; None if no number of misses would show it."""
    most = int(binom.ppf(1.0 - confidence, flights, rate))  # successes that still reject
    most -= binom.cdf(most, flights, rate) > 1.0 - confidence
    if most < 0:
        return None
    return max(0.0, rate - float(special.bdtri(most, flights, power)))


def single_power(flights: int, required: float, true: float, confidence: float) -> float:
    """Probability that `flights` of a policy with the rate `true` show that it is above `required`."""
    least = int(binom.isf(1.0 - confidence, flights, required)) + 1  # successes that reject "not above"
    return float(binom.sf(least - 1, flights, true))


@lru_cache(maxsize=4096)
def _least_wins(differing: int, tail: float) -> int:
    """Of `differing` pairs, how many the better policy must win for a sign test to reject."""
    return int(binom.isf(tail, differing, 0.5)) + 1


def pair_power(pairs: int, gain: float, differing: float, confidence: float) -> float:
    """Probability that an exact two-sided sign test on `pairs` seeds shows a gain of `gain`.

    `differing`: share of the seeds on which the two policies differ; it is taken to be no less than `gain`.
    """
    differing = max(differing, gain)
    counts = np.arange(pairs + 1)
    weights = binom.pmf(counts, pairs, differing)
    kept = counts[weights > 1e-9]
    wins = np.array([_least_wins(int(count), (1.0 - confidence) / 2.0) for count in kept])
    return float(np.sum(weights[kept] * binom.sf(wins - 1, kept, 0.5 * (1.0 + gain / differing))))


def detectable_gain(pairs: int, differing: float, confidence: float = 0.95, power: float = 0.8) -> float | None:
    """The smallest gain that a sign test on `pairs` seeds shows with probability `power`; None if it can show none."""
    if pair_power(pairs, 1.0, differing, confidence) < power:
        return None
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (low, middle) if pair_power(pairs, middle, differing, confidence) >= power else (middle, high)
    return high


def flights_for(power_of: Callable[[int], float], power: float) -> int | None:
    """The fewest flights from which on `power_of(flights)` stays at `power` or above (it moves in steps); None above
    `MOST`."""
    count = 1
    while not _stays(power_of, count, power):
        count *= 2
        if count > MOST:
            return None
    low = count // 2
    while count - low > 1:
        middle = (low + count) // 2
        low, count = (low, middle) if _stays(power_of, middle, power) else (middle, count)
    return count


def _stays(power_of: Callable[[int], float], count: int, power: float) -> bool:
    return all(power_of(count + more) >= power for more in (0, 1, 2, 4, 8, 16))
