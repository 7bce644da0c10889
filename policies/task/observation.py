"""What a policy sees, s_t = [v, vec(R), history, rho, a_(t-1)] (paper Sec. "Observations and Actions"), as one kernel.

Everything is expressed in the vehicle's yaw frame (the world turned about z so that the vehicle faces +x), so that the
observation does not depend on the heading. Yaw is taken from the body y axis: that axis stays near the horizontal
during the flare, where the yaw of the body x axis would turn by large angles.

Deviations from the paper, part of the layout's version: the history may keep every `stride`-th control step, so that 30
entries span more than 0.3 s; two slots hold the vehicle's own estimates (policies/estimation/thrust_drag.py) of its
thrust gain (achieved over asked) and drag (1/s); one holds the one-sigma of the board's surface (m).

Layout of the OBS_DIM float32 numbers: HISTORY entries, oldest first, of
  [p_rel (3: board at that time minus vehicle now), outward normal (3), board velocity (2), turn rate, t - now],
then v (3), R (9, row-major, yaw frame from body), rho, previous action (4: roll, pitch, yaw rate, thrust in [-1, 1]),
gain, drag, surface sigma.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from kernel.clip import clip, command_within
from kernel.jit import njit
from policies.task import entry_row, history_row, tail_row
from vehicle.quadrotor import command_row, limits_row

LAYOUT_NAME, LAYOUT_VERSION = "perchrl-yaw", 3

HISTORY = 30  # H of the paper
TAIL = HISTORY * entry_row.DIM  # index of the first entry after the history
NEWEST = TAIL - entry_row.DIM
OBS_DIM = TAIL + tail_row.DIM

USUAL_DRAG = 0.2  # 1/s, of an open frame of the paper's size

MAX_STRIDE = 10


def history_dim(stride: int) -> int:
    """Length of a history row for entries every `stride` control steps."""
    if not 1 <= stride <= MAX_STRIDE:
        raise ValueError(f"history stride is {stride}; give 1 to {MAX_STRIDE}")
    return history_row.RING + HISTORY * stride * entry_row.DIM


@njit
def entry_place(number, stride, count):
    """Index of entry `number` in a ring of `stride` times `count` entries; those `stride` apart are neighbours in it.

    What is read together then lies together in memory.
    """
    return (number % stride * count + number // stride % count) * entry_row.DIM


@njit
def write_entry(board, seconds, out):
    """Write [x, y, z, normal, vx, vy, turn rate, seconds] of a board row into `out` (entry_row.DIM,)."""
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    p, n, v = entry_row.P, entry_row.NORMAL, entry_row.V
    out[p], out[p + 1], out[p + 2] = board[board_row.X], board[board_row.Y], board[board_row.Z]
    out[n], out[n + 1], out[n + 2] = -si * ch, -si * sh, ci
    out[v], out[v + 1] = board[board_row.SPEED] * ch, board[board_row.SPEED] * sh
    out[entry_row.TURN_RATE] = board[board_row.TURN_RATE]
    out[entry_row.TIME] = seconds


@njit
def clear_history(row):
    """Empty the history row; the next `push_history` begins it anew."""
    row[history_row.HEAD] = row[history_row.FILL] = 0.0


@njit
def _newest(row):
    """The newest entry of a history row, a view."""
    stride = (row.shape[0] - history_row.RING) // (HISTORY * entry_row.DIM)
    at = history_row.RING + entry_place(int(row[history_row.HEAD]), stride, HISTORY)
    return row[at : at + entry_row.DIM]


@njit
def push_history(board, seconds, row):
    """Append a board row, true or believed, at time `seconds` (any epoch, rising by one control step a call)."""
    size = (row.shape[0] - history_row.RING) // entry_row.DIM
    row[history_row.HEAD] = (int(row[history_row.HEAD]) + 1) % size if row[history_row.FILL] > 0.0 else 0
    row[history_row.FILL] = min(row[history_row.FILL] + 1.0, float(size))
    write_entry(board, seconds, _newest(row))


@njit
def renew_history(board, seconds, row):
    """Put a board row at time `seconds` in place of the newest one, after a detection between two control steps."""
    if row[history_row.FILL] > 0.0:
        write_entry(board, seconds, _newest(row))
    else:
        push_history(board, seconds, row)


@njit
def yaw_axes(q):
    """(cos, sin) of the vehicle's yaw, from the body y axis; `q` (4,) wxyz, world from body."""
    yx = 2.0 * (q[1] * q[2] - q[0] * q[3])
    yy = 1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3])
    length = math.sqrt(yx * yx + yy * yy)
    if length < 1e-6:
        return 1.0, 0.0
    return yy / length, -yx / length


@njit
def _relative_entry(entry, p, c, s, now, out):
    dx, dy, dz = entry[entry_row.P] - p[0], entry[entry_row.P + 1] - p[1], entry[entry_row.P + 2] - p[2]
    nx, ny, nz = entry[entry_row.NORMAL], entry[entry_row.NORMAL + 1], entry[entry_row.NORMAL + 2]
    vx, vy, turn, seconds = (
        entry[entry_row.V],
        entry[entry_row.V + 1],
        entry[entry_row.TURN_RATE],
        entry[entry_row.TIME],
    )
    out[entry_row.P], out[entry_row.P + 1], out[entry_row.P + 2] = c * dx + s * dy, c * dy - s * dx, dz
    out[entry_row.NORMAL], out[entry_row.NORMAL + 1], out[entry_row.NORMAL + 2] = c * nx + s * ny, c * ny - s * nx, nz
    out[entry_row.V], out[entry_row.V + 1] = c * vx + s * vy, c * vy - s * vx
    out[entry_row.TURN_RATE], out[entry_row.TIME] = turn, seconds - now


@njit
def relative_entries(ring, stride, count, last, used, p, c, s, now, out):
    """Write `used` entries, `stride` apart up to number `last`, to `out`, relative to the vehicle at `p` (3,).

    `ring`: `stride` times `count` entries (`entry_place`); (c, s): the vehicle's yaw, in whose frame they are written;
    `now` s: time is written relative to it.
    """
    first, newest = last % stride * count, last // stride % count
    for i in range(used):
        k = newest - (used - 1 - i)
        at, to = (first + (k if k >= 0 else k + count)) * entry_row.DIM, i * entry_row.DIM
        _relative_entry(ring[at : at + entry_row.DIM], p, c, s, now, out[to : to + entry_row.DIM])


@njit
def _relative_history(row, p, c, s, stride, now, out):
    """Write the HISTORY entries of a history row to `out`, as `relative_entries` does."""
    head, fill = int(row[history_row.HEAD]), int(row[history_row.FILL])
    repeated = max(0, HISTORY - 1 - (fill - 1) // stride)
    ring, recent = row[history_row.RING :], out[repeated * entry_row.DIM : TAIL]
    relative_entries(ring, stride, HISTORY, head, HISTORY - repeated, p, c, s, now, recent)
    if repeated > 0:  # the ring's oldest entry, number 0
        _relative_entry(ring[: entry_row.DIM], p, c, s, now, out[: entry_row.DIM])
        for k in range(entry_row.DIM, repeated * entry_row.DIM):
            out[k] = out[k - entry_row.DIM]


@njit
def build_observation(row, p, v, q, rho, previous, gain, drag, sigma, stride, now, out):
    """Write the observation into `out` ((OBS_DIM,) float32).

    `row`: history row with at least one entry; `p`, `v` (3,), `q` (4,): the vehicle, world; `rho` reliability;
    `previous` (4,) last action in [-1, 1]; `gain`, `drag` (1/s) estimates; `sigma` m of the board's surface; `stride`:
    control steps between entries; `now`: s, the epoch of `push_history`. Before the ring is full its oldest entry is
    repeated, with its true time.
    """
    c, s = yaw_axes(q)
    _relative_history(row, p, c, s, stride, now, out)
    w, x, y, z = q[0], q[1], q[2], q[3]
    t, k = TAIL, TAIL + tail_row.V
    out[k], out[k + 1], out[k + 2] = c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]
    xx, xy, xz = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    yx, yy, yz = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    k = TAIL + tail_row.R
    out[k], out[k + 1], out[k + 2] = c * xx + s * yx, c * xy + s * yy, c * xz + s * yz
    out[k + 3], out[k + 4], out[k + 5] = c * yx - s * xx, c * yy - s * xy, c * yz - s * xz
    out[k + 6], out[k + 7], out[k + 8] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
    out[t + tail_row.RHO] = rho
    for i in range(4):
        out[t + tail_row.ACTION + i] = previous[i]
    out[t + tail_row.GAIN], out[t + tail_row.DRAG], out[t + tail_row.SIGMA] = gain, drag, sigma


@njit
def command_from_action(action, limits, out):
    """Normalised action (4,), clipped to [-1, 1], to CTBR `out` (4,): body rate rad/s (3), thrust m/s^2.

    NaN where the action is not finite.

    `limits` (limits_row.DIM,): what may be asked of the vehicle (paper Eq. of the CTBR action).
    """
    for i in range(3):
        out[i] = limits[limits_row.BODY_RATE] * command_within(action[i], -1.0, 1.0)
    thrust = command_within(action[command_row.THRUST], -1.0, 1.0)
    low, high = limits[limits_row.THRUST_MIN], limits[limits_row.THRUST_MAX]
    out[command_row.THRUST] = 0.5 * (1.0 - thrust) * low + 0.5 * (1.0 + thrust) * high


@njit
def action_from_command(command, limits, out):
    """Inverse of `command_from_action`, clipped to [-1, 1]; NaN stays NaN."""
    for i in range(3):
        out[i] = clip(command[i] / limits[limits_row.BODY_RATE], -1.0, 1.0)
    low, high = limits[limits_row.THRUST_MIN], limits[limits_row.THRUST_MAX]
    middle, half = 0.5 * (high + low), 0.5 * (high - low)
    out[command_row.THRUST] = clip((command[command_row.THRUST] - middle) / half, -1.0, 1.0)


class ObservationBuilder:
    """Observations in flight: belief and odometry in, observation out, at each control step and between two."""

    def __init__(self, stride: int) -> None:
        self._stride = stride
        self._row = np.zeros(history_dim(stride))
        self._out = np.zeros(OBS_DIM, dtype=np.float32)
        self._epoch_ns = 0
        self.rejected = 0

    def reset(self) -> None:
        """Forget the history, as at the start of an attempt."""
        clear_history(self._row)

    def push(self, now_ns: int, board: np.ndarray, between: bool = False) -> bool:
        """Append this step's belief ((8,) board row at `now_ns`); False and counted if it is not finite.

        `between` two control steps it takes the newest one's place: the history keeps one entry a step.
        """
        if not np.isfinite(board).all():
            self.rejected += 1
            return False
        if self._row[history_row.FILL] == 0.0:
            self._epoch_ns = now_ns
        (renew_history if between else push_history)(board, (now_ns - self._epoch_ns) * 1e-9, self._row)
        return True

    def build(
        self,
        now_ns: int,
        position: np.ndarray,
        velocity: np.ndarray,
        orientation: np.ndarray,
        rho: float,
        previous_action: np.ndarray,
        thrust_gain: float = 1.0,
        drag: float = USUAL_DRAG,
        sigma: float = 0.0,
    ) -> np.ndarray:
        """The observation ((OBS_DIM,) float32, overwritten by the next call). Frames and units: `build_observation`.

        Raises ValueError if nothing was pushed yet or a number is not finite.
        """
        if self._row[history_row.FILL] == 0.0:
            raise ValueError("observation asked for before any belief was pushed; call push() first")
        now = (now_ns - self._epoch_ns) * 1e-9
        build_observation(
            self._row,
            position,
            velocity,
            orientation,
            rho,
            previous_action,
            thrust_gain,
            drag,
            sigma,
            self._stride,
            now,
            self._out,
        )
        if not np.isfinite(self._out).all():
            raise ValueError(
                "observation is not finite; the vehicle's odometry, rho, thrust gain, drag or sigma is NaN or infinite"
            )
        return self._out
