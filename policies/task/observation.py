"""What a policy sees, s_t = [v, vec(R), history, rho, a_(t-1)] (paper Sec. "Observations and Actions"), as one kernel.

Everything is expressed in the drone's yaw frame (world turned about z so that the drone faces +x), which makes the
policy blind to where north is. Yaw is taken from the body y axis: that axis stays near the horizontal while the drone
flares, where yaw from the body x axis would spin.

Deviations from the paper, part of the layout's version: the history may keep every `stride`-th control step, so that 30
entries span more than 0.3 s; two slots hold what the drone found out about itself (policies/estimation/thrust_drag.py),
its thrust gain (achieved over asked) and its drag (1/s); one how well the board is seen (belief.surface_sigma, m).

Layout of the OBS_DIM float32 numbers: HISTORY entries, oldest first, of
  [p_rel (3: board at that time minus drone now), outward normal (3), board velocity (2), turn rate, t - now],
then v (3), R (9, row-major, world from body), rho, previous action (4: roll, pitch, yaw rate, thrust in [-1, 1]), gain,
drag, surface sigma.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit
from vehicle.quadrotor import limits_row

LAYOUT_NAME, LAYOUT_VERSION = "perchrl-yaw", 3

HISTORY = 30  # H of the paper
ENTRY_DIM = 10
TAIL_V, TAIL_R, TAIL_RHO, TAIL_ACTION, TAIL_GAIN, TAIL_DRAG, TAIL_SIGMA, TAIL_DIM = 0, 3, 12, 13, 17, 18, 19, 20
TAIL = HISTORY * ENTRY_DIM  # index of the first entry after the history
NEWEST = TAIL - ENTRY_DIM
OBS_DIM = TAIL + TAIL_DIM

USUAL_DRAG = 0.2  # 1/s, of an open frame of the paper's size

# A history row: the ring's head and fill, then RING entries [x, y, z, normal (3), vx, vy, turn rate, time].
HEAD, FILL, RING_START = 0, 1, 2
MAX_STRIDE = 10


def history_dim(stride: int) -> int:
    """Length of a history row for entries every `stride` control steps."""
    if not 1 <= stride <= MAX_STRIDE:
        raise ValueError(f"history stride is {stride}; give 1 to {MAX_STRIDE}")
    return RING_START + ((HISTORY - 1) * stride + 1) * ENTRY_DIM


@njit
def write_entry(board, seconds, out, at):
    """Write [x, y, z, normal, vx, vy, turn rate, seconds] of a board row into `out` from index `at`."""
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    out[at], out[at + 1], out[at + 2] = board[board_row.X], board[board_row.Y], board[board_row.Z]
    out[at + 3], out[at + 4], out[at + 5] = -si * ch, -si * sh, ci
    out[at + 6], out[at + 7], out[at + 8] = (
        board[board_row.SPEED] * ch,
        board[board_row.SPEED] * sh,
        board[board_row.TURN_RATE],
    )
    out[at + 9] = seconds


@njit
def clear_history(row):
    """Forget everything; the next `push_history` fills the whole ring."""
    row[HEAD] = row[FILL] = 0.0


@njit
def push_history(board, seconds, row):
    """Append a board row, true or believed, at time `seconds` (any epoch, rising by one control step a call)."""
    size = (row.shape[0] - RING_START) // ENTRY_DIM
    head = (int(row[HEAD]) + 1) % size if row[FILL] > 0.0 else 0
    write_entry(board, seconds, row, RING_START + head * ENTRY_DIM)
    row[HEAD] = head
    row[FILL] = min(row[FILL] + 1.0, float(size))


@njit
def renew_history(board, seconds, row):
    """Put a board row at time `seconds` in place of the newest one: what a picture told between control steps."""
    if row[FILL] > 0.0:
        write_entry(board, seconds, row, RING_START + int(row[HEAD]) * ENTRY_DIM)
    else:
        push_history(board, seconds, row)


@njit
def yaw_axes(q):
    """(cos, sin) of the drone's yaw, from the body y axis; `q` (4,) wxyz, world from body."""
    yx = 2.0 * (q[1] * q[2] - q[0] * q[3])
    yy = 1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3])
    length = math.sqrt(yx * yx + yy * yy)
    if length < 1e-6:
        return 1.0, 0.0
    return yy / length, -yx / length


@njit
def relative_entry(entry, at, p, c, s, now, out, to):
    """One stored entry at `entry[at:]` seen from drone position `p` in the yaw frame (c, s), into `out[to:]`."""
    dx, dy = entry[at] - p[0], entry[at + 1] - p[1]
    out[to], out[to + 1], out[to + 2] = c * dx + s * dy, c * dy - s * dx, entry[at + 2] - p[2]
    nx, ny = entry[at + 3], entry[at + 4]
    out[to + 3], out[to + 4], out[to + 5] = c * nx + s * ny, c * ny - s * nx, entry[at + 5]
    vx, vy = entry[at + 6], entry[at + 7]
    out[to + 6], out[to + 7] = c * vx + s * vy, c * vy - s * vx
    out[to + 8] = entry[at + 8]
    out[to + 9] = entry[at + 9] - now


@njit
def build_observation(row, p, v, q, rho, previous, gain, drag, sigma, stride, now, out):
    """Write the observation into `out` ((OBS_DIM,) float32).

    `row`: history row with at least one entry; `p`, `v` (3,), `q` (4,): the drone, world; `rho` reliability; `previous`
    (4,) last action in [-1, 1]; `gain`, `drag` (1/s) estimates; `sigma` m of the board's surface; `stride`: control
    steps between entries; `now`: s, the epoch of `push_history`. Before the ring is full its oldest entry is repeated
    (its t says how old it really is).
    """
    c, s = yaw_axes(q)
    size = (row.shape[0] - RING_START) // ENTRY_DIM
    head, fill = int(row[HEAD]), int(row[FILL])
    for i in range(HISTORY):
        back = min((HISTORY - 1 - i) * stride, fill - 1)
        slot = head - back
        if slot < 0:
            slot += size
        relative_entry(row, RING_START + slot * ENTRY_DIM, p, c, s, now, out, i * ENTRY_DIM)
    w, x, y, z = q[0], q[1], q[2], q[3]
    t = TAIL
    out[t], out[t + 1], out[t + 2] = c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]
    xx, xy, xz = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    yx, yy, yz = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    out[t + 3], out[t + 4], out[t + 5] = c * xx + s * yx, c * xy + s * yy, c * xz + s * yz
    out[t + 6], out[t + 7], out[t + 8] = c * yx - s * xx, c * yy - s * xy, c * yz - s * xz
    out[t + 9], out[t + 10], out[t + 11] = (
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
    out[t + TAIL_RHO] = rho
    for i in range(4):
        out[t + TAIL_ACTION + i] = previous[i]
    out[t + TAIL_GAIN], out[t + TAIL_DRAG], out[t + TAIL_SIGMA] = gain, drag, sigma


@njit
def command_from_action(action, limits, out):
    """Normalised action (4,), clipped to [-1, 1], to CTBR `out` (4,): body rate rad/s (3), thrust m/s^2.

    `limits` (limits_row.DIM,): what may be asked of the vehicle (paper Eq. of the CTBR action).
    """
    for i in range(3):
        out[i] = limits[limits_row.BODY_RATE] * min(1.0, max(-1.0, action[i]))
    thrust = min(1.0, max(-1.0, action[3]))
    low, high = limits[limits_row.THRUST_MIN], limits[limits_row.THRUST_MAX]
    out[3] = 0.5 * (1.0 - thrust) * low + 0.5 * (1.0 + thrust) * high


@njit
def action_from_command(command, limits, out):
    """Inverse of `command_from_action`, clipped to [-1, 1]."""
    for i in range(3):
        out[i] = min(1.0, max(-1.0, command[i] / limits[limits_row.BODY_RATE]))
    low, high = limits[limits_row.THRUST_MIN], limits[limits_row.THRUST_MAX]
    middle, half = 0.5 * (high + low), 0.5 * (high - low)
    out[3] = min(1.0, max(-1.0, (command[3] - middle) / half))


class ObservationBuilder:
    """The flight's side: belief and odometry in, observation out, at each control step and between two."""

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
        if self._row[FILL] == 0.0:
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
        if self._row[FILL] == 0.0:
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
