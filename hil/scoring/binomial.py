"""The exact (Clopper-Pearson) confidence interval of a success rate: how far so few runs can be trusted."""

from __future__ import annotations

import math


def interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """(low, high) of the success probability after `successes` of `runs`. Raises ValueError for impossible counts.

    Clopper and Pearson 1934: the rates at which so many, or so few, successes have probability (1 - confidence) / 2.
    """
    if not 0 <= successes <= runs or runs == 0:
        raise ValueError(f"{successes} successes of {runs} runs is no count")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}: it must lie between 0 and 1")
    tail = (1.0 - confidence) / 2.0
    low = 0.0 if successes == 0 else _solve(lambda p: at_least(successes, runs, p) - tail)
    high = 1.0 if successes == runs else _solve(lambda p: tail - (1.0 - at_least(successes + 1, runs, p)))
    return low, high


def at_least(k: int, n: int, p: float) -> float:
    """P(X >= k) for X ~ Binomial(n, p)."""
    if k <= 0:
        return 1.0
    if p <= 0.0 or p >= 1.0:
        return float(p >= 1.0)
    log_p, log_q = math.log(p), math.log1p(-p)

    def term(i: int) -> float:
        choose = math.lgamma(n + 1) - math.lgamma(i + 1) - math.lgamma(n - i + 1)
        return math.exp(choose + i * log_p + (n - i) * log_q)

    # the shorter sum, so that no digits are lost to a subtraction from one
    if k > n * p:
        return math.fsum(term(i) for i in range(k, n + 1))
    return 1.0 - math.fsum(term(i) for i in range(k))


def _solve(rising) -> float:
    """The root in (0, 1) of a function that rises from below zero to above."""
    low, high = 0.0, 1.0
    while True:
        middle = (low + high) / 2
        if middle in (low, high):
            return middle
        if rising(middle) < 0.0:
            low = middle
        else:
            high = middle
