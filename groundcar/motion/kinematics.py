"""Differential drive: the board dynamics of the paper's appendix "System Dynamics", integrated exactly."""

from __future__ import annotations

import math

from kernel.jit import njit


@njit
def wrap(angle):
    """`angle` (rad) brought into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit
def drive(x, y, heading, speed, turn_rate, dt):
    """(x, y, heading) after `dt` s at constant forward speed (m/s, signed) and turn rate (rad/s): the exact arc.

    heading is not wrapped. The chord of an arc over the angle w dt has length v dt sinc(w dt / 2).
    """
    half = 0.5 * turn_rate * dt
    chord = speed * dt * (math.sin(half) / half if half != 0.0 else 1.0)
    return x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + 2.0 * half


@njit
def accelerate(value, asked, limit, dt):
    """`value` moved towards `asked` by no more than `limit` dt."""
    return value + max(-limit * dt, min(limit * dt, asked - value))


@njit
def wheel_speeds(speed, turn_rate, track):
    """Speeds of the left and right wheels (m/s) of a car with wheels `track` m apart."""
    return speed - 0.5 * track * turn_rate, speed + 0.5 * track * turn_rate
