"""Motion capture of a rigid body: truth in, a slightly noisy state out (0.3 mm, 0.05 deg: a NOKOV-like system)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kernel.random import normal, stream
from kernel.rotations import from_rotation_vector, multiply

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


@dataclass(frozen=True)
class MocapNoise:
    """One-sigma per axis and sample: m, m/s, rad, rad/s. Rates are what the body solver's own filter leaves."""

    position: float = 0.0003
    velocity: float = 0.01
    orientation: float = math.radians(0.05)
    body_rate: float = 0.02


class Mocap:
    """Measures one body; equal seeds give equal noise."""

    def __init__(self, seed: int, noise: MocapNoise | None = None) -> None:
        self._noise, self._rng = noise or MocapNoise(), stream(seed, 0x30CA)

    def measure(
        self, position: Vec3, velocity: Vec3, orientation: Quat, body_rate: Vec3
    ) -> tuple[Vec3, Vec3, Quat, Vec3]:
        """The measured state: m and m/s (world), quaternion wxyz (world from body), rad/s (body)."""
        noise = self._noise
        turn = from_rotation_vector(*self._noisy((0.0, 0.0, 0.0), noise.orientation))
        return (
            self._noisy(position, noise.position),
            self._noisy(velocity, noise.velocity),
            multiply(orientation, turn),
            self._noisy(body_rate, noise.body_rate),
        )

    def _noisy(self, value: Vec3, sigma: float) -> Vec3:
        rng = self._rng
        return (value[0] + sigma * normal(rng), value[1] + sigma * normal(rng), value[2] + sigma * normal(rng))
