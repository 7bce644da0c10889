"""Motion capture of a rigid body: truth in, a slightly noisy state out (0.3 mm, 0.05 deg: a NOKOV-like system)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kernel.jit import njit
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
        return _measured(
            position, velocity, orientation, body_rate, noise.position, noise.velocity, noise.orientation,
            noise.body_rate, self._rng,
        )  # fmt: skip


@njit
def _noisy(value, sigma, rng):
    return value[0] + sigma * normal(rng), value[1] + sigma * normal(rng), value[2] + sigma * normal(rng)


@njit
def _measured(position, velocity, orientation, body_rate, position_sigma, velocity_sigma, turn_sigma, rate_sigma, rng):
    """Position, velocity, orientation and body rate (tuples) with noise of these sigmas."""
    x, y, z = _noisy((0.0, 0.0, 0.0), turn_sigma, rng)
    turn = from_rotation_vector(x, y, z)
    return (
        _noisy(position, position_sigma, rng),
        _noisy(velocity, velocity_sigma, rng),
        multiply(orientation, turn),
        _noisy(body_rate, rate_sigma, rng),
    )
