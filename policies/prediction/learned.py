"""The learned motion predictor: a small network over the belief's last five seconds predicts its motion.

Its outputs are residuals of speed and turn rate at a dozen horizons, added to a base motion that keeps its curvature
and whose acceleration decays. The path is integrated from those, so that position, heading, speed and turn rate of the
rows agree. Inputs are relative to the board's pose now. With a short history or an old detection the caller's analytic
rows are kept.
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from groundcar.motion import board_row
from kernel.clip import clip
from kernel.jit import njit
from policies.estimation import belief_state
from policies.prediction import input_row, net_row, past_row, scratch_row
from policies.prediction.future import HORIZON, STEP

CHECKPOINT = Path(__file__).parents[1] / "checkpoints" / "predictor.npz"
VERSION = 1

SAMPLE = 0.05  # s between entries of the history
LENGTH = 101  # entries: 5 s
_GAP = 0.5  # s without a valid belief, after which the history starts anew
HISTORY_DIM = past_row.RING + LENGTH * past_row.ENTRY_DIM

KNOTS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.5, 1.8, 2.15, 2.6, 3.15)  # s ahead
TAU = 0.5  # s, decay of the acceleration in the network's base
_KNOWN_SPEED, _FADES = 0.2, 1.0  # m/s, s: see believe_filter
_BEND_FROM = 0.5  # m/s, above which curvature is kept rather than the turn rate


@njit
def predictor_clear(history):
    """Empty the history."""
    history[:] = 0.0


@njit
def predictor_push(history, t, x, age):
    """Append the believed board `x` ((8,): board row, last entry acceleration) at `t` s, every SAMPLE s.

    Call it at every tick at which the belief is valid; `age` s of the newest exposure. A gap starts the history anew. A
    board that is not finite is ignored.
    """
    if not math.isfinite(x[belief_state.X] + x[belief_state.Y] + x[belief_state.SPEED] + x[belief_state.TURN_RATE]):
        return
    if not math.isfinite(t + age + x[belief_state.ACCELERATION]):
        return
    if history[past_row.COUNT] > 0.0:
        since = t - history[past_row.TIME]
        if 0.0 <= since < SAMPLE - 1e-6:
            return
        if since < 0.0 or since > _GAP:
            predictor_clear(history)
    head = (int(history[past_row.HEAD]) + 1) % LENGTH
    at = past_row.RING + head * past_row.ENTRY_DIM
    history[at + past_row.X], history[at + past_row.Y] = x[belief_state.X], x[belief_state.Y]
    history[at + past_row.SPEED] = x[belief_state.SPEED]
    history[at + past_row.TURN_RATE] = x[belief_state.TURN_RATE]
    history[at + past_row.ACCELERATION] = x[belief_state.ACCELERATION]
    history[at + past_row.AGE] = age
    history[past_row.HEAD], history[past_row.TIME] = head, t
    history[past_row.COUNT] = min(history[past_row.COUNT] + 1.0, float(LENGTH))


@njit
def predictor_inputs(history, t, x, sigma, speed_sigma, age, streak, out):
    """Fill the network's inputs, the first INPUTS of `out` (float32), for the believed board `x` (8,) at `t` s.

    `sigma` m and `speed_sigma` m/s of the belief, `age` s of the newest exposure, `streak` exposures accepted.
    """
    c, s = math.cos(x[belief_state.HEADING]), math.sin(x[belief_state.HEADING])
    count, head = int(history[past_row.COUNT]), int(history[past_row.HEAD])
    for i in range(input_row.TAPS):
        lag, at = input_row.LAGS[i], i * input_row.CHANNELS
        if lag >= count:
            for j in range(input_row.CHANNELS):
                out[at + j] = 0.0
            out[at + input_row.AGE] = 2.0
            continue
        e = past_row.RING + ((head - lag) % LENGTH) * past_row.ENTRY_DIM
        out[at + input_row.SPEED] = 0.5 * history[e + past_row.SPEED]
        out[at + input_row.TURN_RATE] = history[e + past_row.TURN_RATE]
        out[at + input_row.ACCELERATION] = 0.5 * history[e + past_row.ACCELERATION]
        out[at + input_row.AGE] = min(1.0, history[e + past_row.AGE])
        older = input_row.LAGS[i + 1] if i + 1 < input_row.TAPS else lag + 3
        out[at + input_row.ALONG], out[at + input_row.ACROSS] = 0.0, 0.0
        if older < count:
            o = past_row.RING + ((head - older) % LENGTH) * past_row.ENTRY_DIM
            scale = 0.5 / ((older - lag) * SAMPLE)
            dx = scale * (history[e + past_row.X] - history[o + past_row.X])
            dy = scale * (history[e + past_row.Y] - history[o + past_row.Y])
            out[at + input_row.ALONG] = clip(c * dx + s * dy, -3.0, 3.0)
            out[at + input_row.ACROSS] = clip(c * dy - s * dx, -3.0, 3.0)
    now = input_row.NOW
    out[now + input_row.SPEED] = 0.5 * x[belief_state.SPEED]
    out[now + input_row.TURN_RATE] = x[belief_state.TURN_RATE]
    out[now + input_row.ACCELERATION] = 0.5 * x[belief_state.ACCELERATION]
    out[now + input_row.AGE] = min(1.0, age)
    out[now + input_row.SIGMA] = min(1.0, 10.0 * sigma)
    out[now + input_row.SPEED_SIGMA] = min(2.0, 2.0 * speed_sigma)
    out[now + input_row.STREAK] = min(1.0, streak / 40.0)
    out[now + input_row.SINCE] = 20.0 * clip(t - history[past_row.TIME], 0.0, SAMPLE)


@njit
def predictor_network(net, scratch):
    """Run the network on the inputs in `scratch` (policies.prediction.scratch_row) and write its outputs there."""
    h1, h2, out = (
        scratch[scratch_row.HIDDEN1 : scratch_row.HIDDEN2],
        scratch[scratch_row.HIDDEN2 : scratch_row.OUTPUT],
        scratch[scratch_row.OUTPUT : scratch_row.DIM],
    )
    h1[:] = net[net_row.B1 : net_row.W2]
    for i in range(net_row.INPUTS):
        v = scratch[i]
        if v != 0.0:
            w = net[net_row.W1 + i * net_row.HIDDEN1 : net_row.W1 + (i + 1) * net_row.HIDDEN1]
            for j in range(net_row.HIDDEN1):
                h1[j] += v * w[j]
    h2[:] = net[net_row.B2 : net_row.W3]
    for i in range(net_row.HIDDEN1):
        v = h1[i]
        if v > 0.0:
            w = net[net_row.W2 + i * net_row.HIDDEN2 : net_row.W2 + (i + 1) * net_row.HIDDEN2]
            for j in range(net_row.HIDDEN2):
                h2[j] += v * w[j]
    out[:] = net[net_row.B3 : net_row.LIMITS]
    for i in range(net_row.HIDDEN2):
        v = h2[i]
        if v > 0.0:
            w = net[net_row.W3 + i * net_row.OUTPUTS : net_row.W3 + (i + 1) * net_row.OUTPUTS]
            for j in range(net_row.OUTPUTS):
                out[j] += v * w[j]


@njit
def base_motion(speed, turn_rate, acceleration, ahead):
    """(speed, turn rate) `ahead` s from now of a car that keeps its curvature and whose acceleration decays."""
    then = speed + acceleration * TAU * (1.0 - math.exp(-ahead / TAU))
    if abs(speed) > _BEND_FROM:
        return then, turn_rate * clip(then / speed, -1.0, 2.0)
    return then, turn_rate


@njit
def predictor_trust(net, history, age):
    """How far the network is trusted, 0..1, by the length of its history and the age (s) of the newest exposure."""
    seen = history[past_row.COUNT] * SAMPLE
    known = (seen - net[net_row.SHORT]) / (net[net_row.LONG] - net[net_row.SHORT])
    fresh = (net[net_row.OLD] - age) / (net[net_row.OLD] - net[net_row.FRESH])
    return clip(known, 0.0, 1.0) * clip(fresh, 0.0, 1.0)


@njit
def believe_filter(speed_sigma, scratch):
    """Reduce the network's correction of the present speed, the more the better the filter knows that speed.

    At `speed_sigma` = _KNOWN_SPEED half of it is left; the reduction fades with the time ahead.
    """
    fine = scratch[scratch_row.OUTPUT] / (1.0 + (speed_sigma / _KNOWN_SPEED) ** 2)
    for knot in range(net_row.KNOTS):
        scratch[scratch_row.OUTPUT + knot] -= fine * math.exp(-KNOTS[knot] / _FADES)


@njit
def integrate_rows(step, out):
    """Rewrite positions and headings of `out` ((R, 8)) from its first pose and every row's speed and turn rate."""
    for k in range(1, out.shape[0]):
        a, b = out[k - 1], out[k]
        turn = 0.5 * step * (a[board_row.TURN_RATE] + b[board_row.TURN_RATE])
        half = 0.5 * turn
        chord = 0.5 * step * (a[board_row.SPEED] + b[board_row.SPEED]) * (1.0 - half * half / 6.0)
        b[board_row.X] = a[board_row.X] + chord * math.cos(a[board_row.HEADING] + half)
        b[board_row.Y] = a[board_row.Y] + chord * math.sin(a[board_row.HEADING] + half)
        b[board_row.HEADING] = a[board_row.HEADING] + turn


@njit
def predict_learned(history, t, x, sigma, speed_sigma, age, streak, step, net, scratch, most, future):
    """Correct `future` ((R, 8), already filled by an analytic prediction) by the network's residuals.

    `history` row; `t` s; `x` (8,): the filter's own row now; `sigma`, `speed_sigma`, `age`, `streak`
    as in an estimate row; `net` and `scratch`: a net row and a scratch row; `most` 0..1: how far its speeds are
    trusted if all else is well. Returns (trust 0..1, expected rms error of the speed over the next 0.7 s, m/s); at
    trust 0 `future` is left alone and the error is meaningless.
    """
    trust = predictor_trust(net, history, age)
    if trust <= 0.0:
        return 0.0, 0.0
    predictor_inputs(history, t, x, sigma, speed_sigma, age, streak, scratch)
    predictor_network(net, scratch)
    believe_filter(speed_sigma, scratch)
    knot = 0
    for k in range(future.shape[0]):
        ahead = k * step
        while knot < net_row.KNOTS - 2 and ahead > KNOTS[knot + 1]:
            knot += 1
        s = min(1.0, (ahead - KNOTS[knot]) / (KNOTS[knot + 1] - KNOTS[knot]))
        speed, turn = base_motion(x[belief_state.SPEED], x[belief_state.TURN_RATE], x[belief_state.ACCELERATION], ahead)
        speed += (1.0 - s) * scratch[scratch_row.OUTPUT + knot] + s * scratch[scratch_row.OUTPUT + knot + 1]
        turn += (1.0 - s) * scratch[scratch_row.OUTPUT + net_row.KNOTS + knot] + s * scratch[
            scratch_row.OUTPUT + net_row.KNOTS + knot + 1
        ]
        row = future[k]
        row[board_row.SPEED] += most * trust * (clip(speed, -4.0, 4.0) - row[board_row.SPEED])
        row[board_row.TURN_RATE] += trust * (clip(turn, -2.5, 2.5) - row[board_row.TURN_RATE])
    integrate_rows(step, future)
    return trust, math.exp(clip(scratch[scratch_row.DIM - 1], -5.0, 1.0))


def interpolation(rows: int = HORIZON, step: float = STEP) -> np.ndarray:
    """(K, rows) matrix that takes values at KNOTS to values at the rows, as `predict_learned` does."""
    out = np.zeros((net_row.KNOTS, rows))
    for k, ahead in enumerate(np.arange(rows) * step):
        i = min(net_row.KNOTS - 2, max(0, int(np.searchsorted(KNOTS, ahead)) - 1))
        s = min(1.0, (ahead - KNOTS[i]) / (KNOTS[i + 1] - KNOTS[i]))
        out[i, k], out[i + 1, k] = 1.0 - s, s
    return out


def pack_network(
    layers: list[tuple[np.ndarray, np.ndarray]], limits: tuple[float, float, float, float, float]
) -> np.ndarray:
    """The net row ((net_row.DIM,) float32) of three (weights (in, out), bias) pairs and the limits of trust.

    `limits`: (SHORT, LONG, FRESH, OLD, DOUBT) of net_row. Raises ValueError for a wrong shape, number or limit.
    """
    shapes = [
        (net_row.INPUTS, net_row.HIDDEN1),
        (net_row.HIDDEN1, net_row.HIDDEN2),
        (net_row.HIDDEN2, net_row.OUTPUTS),
    ]
    if [w.shape for w, _ in layers] != shapes or [b.shape for _, b in layers] != [(n,) for _, n in shapes]:
        raise ValueError(f"a predictor needs layers of {shapes}, not {[w.shape for w, _ in layers]}")
    if not (0.0 <= limits[0] < limits[1] and 0.0 <= limits[2] < limits[3] and 0.0 <= limits[4] <= 1.0):
        raise ValueError(
            f"the limits of the predictor's trust are {limits}: it must rise with history and fall with age"
        )
    row = np.concatenate([part.ravel() for pair in layers for part in pair] + [np.array(limits)]).astype(np.float32)
    if not np.isfinite(row).all():
        raise ValueError("the predictor's weights are not all finite")
    return row


def save_predictor(path: Path, net: np.ndarray, note: str) -> None:
    """Write a predictor's net row to `path`, with a note of its origin."""
    np.savez_compressed(path, version=VERSION, knots=np.array(KNOTS), net=net, note=note)


def load_predictor(path: Path = CHECKPOINT) -> np.ndarray:
    """The net row. Raises FileNotFoundError, or ValueError for a file of another version or corrupt."""
    if not path.exists():
        raise FileNotFoundError(
            f"no motion predictor at {path}: train one with python -m policies.prediction.learned_training"
        )
    return read_predictor(path.read_bytes(), path)


def read_predictor(content: bytes, path: Path) -> np.ndarray:
    """The net row out of a predictor file's `content`; `path` names it. Raises ValueError as `load_predictor`."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            version, knots, net = int(data["version"]), data["knots"], data["net"]
    except Exception as error:
        raise ValueError(f"{path} is no motion predictor: {error}") from error
    if (
        version != VERSION
        or net.shape != (net_row.DIM,)
        or knots.shape != (net_row.KNOTS,)
        or not np.allclose(knots, KNOTS)
    ):
        raise ValueError(f"{path} is a motion predictor of version {version}, this is {VERSION}: train it again")
    if net.dtype != np.float32 or not np.isfinite(net).all():
        raise ValueError(f"{path}: the motion predictor's weights are not finite 32-bit numbers")
    return net
