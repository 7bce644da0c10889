"""Poses over time as arrays: rotation, interpolation, and the approach in the board's frame. World ENU, body FLU."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Motion(NamedTuple):
    """A body: `t` (n,) int64 ns; `position`, `velocity` (n, 3); `orientation` (n, 4) wxyz, world from body."""

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    orientation: np.ndarray


class Approach(NamedTuple):
    """The vehicle in the board's frame over time. Rows (n, 3): x up-slope, y left, z along the outward normal."""

    t: np.ndarray  # ns
    magnet: np.ndarray  # m, face of the magnet
    forward: np.ndarray  # unit, the vehicle's body x
    left: np.ndarray  # unit, its body y
    normal_error: np.ndarray  # (n,) rad, between body z and the normal
    closing: np.ndarray  # (n, 3) m/s, velocity of the centre of mass relative to the board's centre


def axes(orientation: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of unit quaternions (n, 4) wxyz; the columns are the body's axes in the world."""
    w, x, y, z = orientation.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def at(motion: Motion, t: np.ndarray) -> Motion:
    """`motion` at times `t` (ns): linear between samples; NaN outside of them, never extrapolated."""
    origin = motion.t[0]
    known, wanted = (motion.t - origin).astype(np.float64), (t - origin).astype(np.float64)

    def column(values: np.ndarray) -> np.ndarray:
        return np.interp(wanted, known, values, left=np.nan, right=np.nan)

    q = motion.orientation
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0))
    q = np.column_stack([column(c) for c in (q * np.concatenate([[1.0], flips])[:, None]).T])
    with np.errstate(invalid="ignore"):
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
    position, velocity = (np.column_stack([column(c) for c in v.T]) for v in (motion.position, motion.velocity))
    return Motion(t, position, velocity, q)


def approach(vehicle: Motion, board: Motion, magnet_below: float) -> Approach:
    """The vehicle's approach in the board's frame. `magnet_below` m: from the centre of mass down to the magnet."""
    there = at(board, vehicle.t)
    body, frame = axes(vehicle.orientation), axes(there.orientation)
    magnet = vehicle.position - magnet_below * body[:, :, 2]
    to_board = frame.transpose(0, 2, 1)

    def seen(vectors: np.ndarray) -> np.ndarray:
        return np.einsum("nij,nj->ni", to_board, vectors)

    cosine = np.clip(np.sum(body[:, :, 2] * frame[:, :, 2], axis=1), -1.0, 1.0)
    return Approach(
        vehicle.t,
        seen(magnet - there.position),
        seen(body[:, :, 0]),
        seen(body[:, :, 1]),
        np.arccos(cosine),
        seen(vehicle.velocity - there.velocity),
    )


def nose_up_deg(orientation: np.ndarray) -> np.ndarray:
    """Angle (n,) deg of body x above the horizon: the vehicle's pitch (nose up), the board's inclination."""
    return np.degrees(np.arcsin(np.clip(axes(orientation)[:, 2, 0], -1.0, 1.0)))


def roll_deg(orientation: np.ndarray) -> np.ndarray:
    """Angle (n,) deg about body x after yaw and pitch (Z-Y-X), positive with the right side down."""
    R = axes(orientation)
    return np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]))


def yaw_deg(orientation: np.ndarray) -> np.ndarray:
    """Direction (n,) deg of body x over the ground, counter-clockwise from east, without jumps of 360 degrees."""
    R = axes(orientation)
    return np.degrees(np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0])))


def side_up_deg(orientation: np.ndarray) -> np.ndarray:
    """Angle (n,) deg of body y above the horizon: the board's roll, also on a wall, where Z-Y-X has none."""
    return np.degrees(np.arcsin(np.clip(axes(orientation)[:, 2, 1], -1.0, 1.0)))


def heading_deg(orientation: np.ndarray) -> np.ndarray:
    """Direction (n,) deg over the ground, at right angles to body y: the board's heading, also on a wall."""
    R = axes(orientation)
    return np.degrees(np.unwrap(np.arctan2(-R[:, 0, 1], R[:, 1, 1])))


def specific_thrust(motion: Motion, gravity: float = 9.80665, half_window_s: float = 0.012) -> np.ndarray:
    """Acceleration without gravity along body z (n,) m/s^2, from differences of velocity; NaN at ends and gaps."""
    seconds = (motion.t - motion.t[0]) / 1e9
    step = np.median(np.diff(seconds)) if len(seconds) > 1 else np.nan
    out = np.full(len(seconds), np.nan)
    if not np.isfinite(step) or step <= 0.0:
        return out
    k = max(1, round(half_window_s / step))
    if len(seconds) <= 2 * k:
        return out
    span = seconds[2 * k :] - seconds[: -2 * k]
    with np.errstate(divide="ignore", invalid="ignore"):
        acceleration = (motion.velocity[2 * k :] - motion.velocity[: -2 * k]) / span[:, None]
    acceleration[:, 2] += gravity
    along = np.sum(acceleration * axes(motion.orientation)[k:-k, :, 2], axis=1)
    out[k:-k] = np.where((span > 0) & (span < 3 * k * step), along, np.nan)
    return out
