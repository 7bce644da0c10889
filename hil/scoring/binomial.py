"""The exact (Clopper-Pearson) confidence interval of a success rate: how far so few runs can be trusted."""

from __future__ import annotations

from scipy import special


def interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """(low, high) of the success probability after `successes` of `runs`. Raises ValueError for impossible counts.

    Clopper and Pearson 1934: the rates at which so many, or so few, successes have probability (1 - confidence) / 2.
    """
    if not 0 <= successes <= runs or runs == 0:
        raise ValueError(f"{successes} successes of {runs} runs is no count")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}: it must lie between 0 and 1")
    tail = (1.0 - confidence) / 2.0
    low = 0.0 if successes == 0 else float(special.betaincinv(successes, runs - successes + 1, tail))
    high = 1.0 if successes == runs else float(special.betaincinv(successes + 1, runs - successes, 1.0 - tail))
    return low, high


def at_least(k: int, n: int, p: float) -> float:
    """P(X >= k) for X ~ Binomial(n, p)."""
    if k <= 0:
        return 1.0
    return 0.0 if k > n else float(special.betainc(k, n - k + 1, p))
