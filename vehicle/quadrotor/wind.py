"""Wind: a mean and random gusts, as a velocity of the air in the world."""

from __future__ import annotations

import math

from kernel.random import normal, stream

Vec3 = tuple[float, float, float]


class Wind:
    """Mean wind (m/s, ENU) with an Ornstein-Uhlenbeck gust of one-sigma `gust` (m/s) per axis and `gust_time` (s).

    Gusts are horizontal at full and vertical at half strength, as over open ground. Equal seeds give equal winds when
    asked at equal times.
    """

    def __init__(self, mean: Vec3, gust: float, gust_time: float, seed: int) -> None:
        if gust < 0.0 or gust_time <= 0.0 or not all(map(math.isfinite, (*mean, gust, gust_time))):
            raise ValueError(f"wind needs a finite mean, gust >= 0 and gust_time > 0, not {mean}, {gust}, {gust_time}")
        self._mean, self._time = mean, gust_time
        self._sigma = (gust, gust, 0.5 * gust)
        self._rng = stream(seed, 0x317D)
        self._gust = [sigma * float(normal(self._rng)) for sigma in self._sigma]
        self._stamp_ns: int | None = None

    def at(self, now_ns: int) -> Vec3:
        """Velocity of the air (m/s, ENU) at `now_ns`, which may only rise from call to call."""
        if self._stamp_ns is not None and now_ns > self._stamp_ns:
            keep = math.exp(-(now_ns - self._stamp_ns) * 1e-9 / self._time)
            spread = math.sqrt(1.0 - keep * keep)
            for i, sigma in enumerate(self._sigma):
                if sigma > 0.0:
                    self._gust[i] = keep * self._gust[i] + spread * sigma * float(normal(self._rng))
        self._stamp_ns = now_ns
        x, y, z = (mean + gust for mean, gust in zip(self._mean, self._gust, strict=True))
        return (x, y, z)
