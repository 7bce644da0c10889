"""Control allocation of a quad X as PX4 does it with MC_AIRMODE 0: torque and thrust set-points to motor commands.

Nothing here branches: where nothing saturates every relief is 0, and a loop over vehicles becomes vector instructions.
"""

from __future__ import annotations

from kernel.clip import clip
from kernel.jit import njit

# Which way each motor's command goes for more of it.
_THRUST = (1.0, 1.0, 1.0, 1.0)
_ROLL = (-1.0, 1.0, 1.0, -1.0)
_PITCH = (-1.0, 1.0, -1.0, 1.0)
_YAW = (-1.0, -1.0, 1.0, 1.0)


@njit(forceinline=True)
def _beyond(u, top):
    """How far a command must rise (positive) or fall to be within 0..top."""
    return max(0.0, -u) - max(0.0, u - top)


@njit(forceinline=True)
def _relief(u, signs, top):
    """Step along `signs` (4-tuple of +-1) that takes motors back into 0..top: worst below plus worst above."""
    k0, k1 = signs[0] * _beyond(u[0], top), signs[1] * _beyond(u[1], top)
    k2, k3 = signs[2] * _beyond(u[2], top), signs[3] * _beyond(u[3], top)
    return min(0.0, min(min(k0, k1), min(k2, k3))) + max(0.0, max(max(k0, k1), max(k2, k3)))


@njit(forceinline=True)
def _along(u, signs, k):
    return u[0] + k * signs[0], u[1] + k * signs[1], u[2] + k * signs[2], u[3] + k * signs[3]


@njit(forceinline=True)
def _desaturate(u, signs, top):
    u = _along(u, signs, _relief(u, signs, top))
    return _along(u, signs, 0.5 * _relief(u, signs, top))


@njit(forceinline=True)
def _lower(u):
    """Thrust taken back, never added, where motors ask for more than 1."""
    u = _along(u, _THRUST, min(0.0, _relief(u, _THRUST, 1.0)))
    return _along(u, _THRUST, min(0.0, 0.5 * _relief(u, _THRUST, 1.0)))


@njit(forceinline=True)
def _within(u):
    return (min(min(u[0], u[1]), min(u[2], u[3])) >= 0.0) & (max(max(u[0], u[1]), max(u[2], u[3])) <= 1.0)


@njit(forceinline=True)
def _level(roll, pitch, thrust, a):
    """Commands before yaw."""
    return (
        thrust - a * (roll + pitch),
        thrust + a * (roll + pitch),
        thrust + a * (roll - pitch),
        thrust - a * (roll - pitch),
    )


@njit(forceinline=True)
def mix_freely(roll, pitch, yaw, thrust, a, b):
    """Motor commands as if motors had no limits, and 1.0 where they have (4-tuple, float); arguments as for `mix`.

    Where the float is 0.0 these are the commands of `mix`.
    """
    level = _level(roll, pitch, thrust, a)
    u = _along(level, _YAW, b * yaw)
    return u, 0.0 if _within(level) & _within(u) else 1.0


@njit(forceinline=True)
def mix(roll, pitch, yaw, thrust, a, b):
    """Motor commands (4-tuple, 0..1) for torque set-points (-1..1, FLU) and collective thrust (0..1).

    `a`, `b`: motor command per unit of roll or pitch, and of yaw torque set-point. PX4's order of sacrifice: thrust is
    reduced first (never raised), then roll, pitch, then yaw, which keeps 15 % authority at full thrust.
    """
    u = _lower(_level(roll, pitch, thrust, a))
    u = _desaturate(_desaturate(u, _ROLL, 1.0), _PITCH, 1.0)
    u = _lower(_desaturate(_along(u, _YAW, b * yaw), _YAW, 1.15))
    return (
        clip(u[0], 0.0, 1.0),
        clip(u[1], 0.0, 1.0),
        clip(u[2], 0.0, 1.0),
        clip(u[3], 0.0, 1.0),
    )
