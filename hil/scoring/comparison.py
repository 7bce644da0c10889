"""Two policies on the same seeds: counted in pairs, so that what the seeds have in common cancels out. Pure."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from hil.scoring.binomial import interval

Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True)
class Pairs:
    """Runs of a first and a second policy under equal conditions: how many of the pairs succeeded how."""

    both: int
    only_first: int
    only_second: int
    neither: int

    @property
    def runs(self) -> int:
        """Pairs."""
        return self.both + self.only_first + self.only_second + self.neither

    @property
    def gain(self) -> float:
        """Rate of the second less that of the first; 0 without runs."""
        return (self.only_second - self.only_first) / self.runs if self.runs else 0.0

    def gain_interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Exact given how many pairs differ (Clopper-Pearson on these): contains 0 unless a sign test rejects. Where
        none differs, what so many equal pairs leave open: the exact limit of the share that differs."""
        differ = self.only_first + self.only_second
        if not differ:
            most = interval(0, self.runs, confidence)[1] if self.runs else 1.0
            return -most, most
        low, high = interval(self.only_second, differ, confidence)
        return (2 * low - 1) * differ / self.runs, (2 * high - 1) * differ / self.runs

    def verdict(self, confidence: float = 0.95) -> str:
        """The second against the first, in words."""
        if not self.runs:
            return "no common seed"
        low, high = self.gain_interval(confidence)
        if low > 0:
            return "better"
        if high < 0:
            return "worse"
        return "no difference shown" if self.only_first + self.only_second else "equal on every seed"


def pair(first: Mapping[Key, bool], second: Mapping[Key, bool]) -> Pairs:
    """Successes by condition (scenario, seed, ...) of two policies, where both flew."""
    outcomes = [(first[key], second[key]) for key in first if key in second]
    return Pairs(*(outcomes.count(pair) for pair in ((True, True), (True, False), (False, True), (False, False))))


def words(pairs: Pairs, confidence: float = 0.95) -> str:
    """`better: +20 points (+2 to +35), 5 of 20 seeds gained, 1 lost`."""
    low, high = (100 * bound for bound in pairs.gain_interval(confidence))
    if not pairs.only_first + pairs.only_second:
        left = f", {pairs.runs} of them: +0 points ({low:+.0f} to {high:+.0f})" if pairs.runs else ""
        return pairs.verdict(confidence) + left
    return (
        f"{pairs.verdict(confidence)}: {100 * pairs.gain:+.0f} points ({low:+.0f} to {high:+.0f}), of {pairs.runs} "
        f"seeds {pairs.only_second} gained, {pairs.only_first} lost"
    )
