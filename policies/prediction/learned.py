"""The learned motion predictor: a small network over the belief's last five seconds says how the board goes on.

It answers with what has to be added to a car that keeps its curvature and whose acceleration decays: speed and turn
rate at a dozen horizons. The path is integrated from those, so that position, heading, speed and turn rate of the rows
agree. Everything it sees is relative to where the board is and heads now; a mirrored motion may be seen mirrored.
Where the network knows too little (short history, nothing seen lately) the caller's analytic rows show through.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from kernel.jit import njit
from policies.prediction.future import HORIZON, STEP

CHECKPOINT = Path(__file__).parents[1] / "checkpoints" / "predictor.npz"
VERSION = 1

SAMPLE = 0.05  # s between entries of the history
LENGTH = 101  # entries: 5 s
_GAP = 0.5  # s without a valid belief, after which the history starts anew
# A history row: count, head, time of the newest entry (s), then the ring of entries.
H_COUNT, H_HEAD, H_TIME, H_RING = 0, 1, 2, 3
_ENTRY = 6  # x, y (m, world), speed, turn rate, acceleration, age of the newest exposure
HISTORY_DIM = H_RING + LENGTH * _ENTRY

# Entries looked at, as lags: dense for 0.8 s, then thinner.
_TAPS = tuple([*range(16), *range(17, 48, 2), *range(52, 98, 5)])
TAPS = len(_TAPS)
_CHANNELS = 6
_NOW = 8
INPUTS = TAPS * _CHANNELS + _NOW
HIDDEN1, HIDDEN2 = 128, 96
KNOTS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.5, 1.8, 2.15, 2.6, 3.15)  # s ahead
K = len(KNOTS)
OUTPUTS = 2 * K + 1  # speeds (m/s), turn rates (rad/s), log of the expected speed error (m/s)
TAU = 0.5  # s, decay of the acceleration in the network's base
_KNOWN_SPEED, _FADES = 0.2, 1.0  # m/s, s: see believe_filter
_BEND_FROM = 0.5  # m/s, above which curvature is kept rather than the turn rate

_W1, _B1 = 0, INPUTS * HIDDEN1
_W2 = _B1 + HIDDEN1
_B2 = _W2 + HIDDEN1 * HIDDEN2
_W3 = _B2 + HIDDEN2
_B3 = _W3 + HIDDEN2 * OUTPUTS
_G = _B3 + OUTPUTS
# The gate: 0 with FROM s of history, 1 with FULL s; 1 at exposures younger than YOUNG s, 0 when older than OLD.
# DOUBT: share of the network's own expected speed error in the surprise that the planner is told.
G_FROM, G_FULL, G_YOUNG, G_OLD, G_DOUBT = _G, _G + 1, _G + 2, _G + 3, _G + 4
NET_DIM = _G + 5

# Indices of the scratch row (float32).
_IN, _H1 = 0, INPUTS
_H2 = _H1 + HIDDEN1
_OUT = _H2 + HIDDEN2
SCRATCH_DIM = _OUT + OUTPUTS


@njit
def predictor_clear(history):
    """Forget everything."""
    history[:] = 0.0


@njit
def predictor_push(history, t, x, age):
    """Remember the believed board `x` ((8,): board row, last entry acceleration) at `t` s, every SAMPLE s.

    Call it at every tick at which the belief is valid; `age` s of the newest exposure. A gap starts the history anew.
    """
    if history[H_COUNT] > 0.0:
        since = t - history[H_TIME]
        if 0.0 <= since < SAMPLE - 1e-6:
            return
        if since < 0.0 or since > _GAP:
            predictor_clear(history)
    head = (int(history[H_HEAD]) + 1) % LENGTH
    entry = history[H_RING + head * _ENTRY : H_RING + (head + 1) * _ENTRY]
    entry[0], entry[1], entry[2], entry[3], entry[4], entry[5] = x[0], x[1], x[4], x[5], x[7], age
    history[H_HEAD], history[H_TIME] = head, t
    history[H_COUNT] = min(history[H_COUNT] + 1.0, float(LENGTH))


@njit
def predictor_inputs(history, t, x, sigma, speed_sigma, age, streak, out):
    """Fill the network's inputs, the first INPUTS of `out` (float32), for the believed board `x` (8,) at `t` s.

    `sigma` m and `speed_sigma` m/s of the belief, `age` s of the newest exposure, `streak` exposures accepted.
    """
    c, s = math.cos(x[3]), math.sin(x[3])
    count, head = int(history[H_COUNT]), int(history[H_HEAD])
    for i in range(TAPS):
        lag, at = _TAPS[i], i * _CHANNELS
        if lag >= count:
            for j in range(_CHANNELS):
                out[at + j] = 0.0
            out[at + 3] = 2.0
            continue
        e = H_RING + ((head - lag) % LENGTH) * _ENTRY
        out[at] = 0.5 * history[e + 2]
        out[at + 1] = history[e + 3]
        out[at + 2] = 0.5 * history[e + 4]
        out[at + 3] = min(1.0, history[e + 5])
        older = _TAPS[i + 1] if i + 1 < TAPS else lag + 3
        out[at + 4], out[at + 5] = 0.0, 0.0
        if older < count:
            o = H_RING + ((head - older) % LENGTH) * _ENTRY
            scale = 0.5 / ((older - lag) * SAMPLE)
            dx, dy = scale * (history[e] - history[o]), scale * (history[e + 1] - history[o + 1])
            out[at + 4] = min(3.0, max(-3.0, c * dx + s * dy))
            out[at + 5] = min(3.0, max(-3.0, c * dy - s * dx))
    at = TAPS * _CHANNELS
    out[at] = 0.5 * x[4]
    out[at + 1] = x[5]
    out[at + 2] = 0.5 * x[7]
    out[at + 3] = min(1.0, age)
    out[at + 4] = min(1.0, 10.0 * sigma)
    out[at + 5] = min(2.0, 2.0 * speed_sigma)
    out[at + 6] = min(1.0, streak / 40.0)
    out[at + 7] = 20.0 * min(SAMPLE, max(0.0, t - history[H_TIME]))


@njit
def predictor_network(net, scratch):
    """Run the network on the inputs in `scratch` ((SCRATCH_DIM,) float32); its outputs are the last OUTPUTS there."""
    h1, h2, out = scratch[_H1:_H2], scratch[_H2:_OUT], scratch[_OUT:SCRATCH_DIM]
    h1[:] = net[_B1:_W2]
    for i in range(INPUTS):
        v = scratch[i]
        if v != 0.0:
            w = net[_W1 + i * HIDDEN1 : _W1 + (i + 1) * HIDDEN1]
            for j in range(HIDDEN1):
                h1[j] += v * w[j]
    h2[:] = net[_B2:_W3]
    for i in range(HIDDEN1):
        v = h1[i]
        if v > 0.0:
            w = net[_W2 + i * HIDDEN2 : _W2 + (i + 1) * HIDDEN2]
            for j in range(HIDDEN2):
                h2[j] += v * w[j]
    out[:] = net[_B3:_G]
    for i in range(HIDDEN2):
        v = h2[i]
        if v > 0.0:
            w = net[_W3 + i * OUTPUTS : _W3 + (i + 1) * OUTPUTS]
            for j in range(OUTPUTS):
                out[j] += v * w[j]


@njit
def base_motion(speed, turn_rate, acceleration, ahead):
    """(speed, turn rate) `ahead` s from now of a car that keeps its curvature and whose acceleration decays."""
    then = speed + acceleration * TAU * (1.0 - math.exp(-ahead / TAU))
    if abs(speed) > _BEND_FROM:
        return then, turn_rate * min(2.0, max(-1.0, then / speed))
    return then, turn_rate


@njit
def predictor_gate(net, history, age):
    """How far the network is trusted, 0..1: not before it has seen enough, not long after it last saw anything."""
    seen = history[H_COUNT] * SAMPLE
    known = (seen - net[G_FROM]) / (net[G_FULL] - net[G_FROM])
    fresh = (net[G_OLD] - age) / (net[G_OLD] - net[G_YOUNG])
    return min(1.0, max(0.0, known)) * min(1.0, max(0.0, fresh))


@njit
def believe_filter(speed_sigma, scratch):
    """Take back what the network would correct of the speed now, as far as the filter knows that speed.

    At `speed_sigma` = _KNOWN_SPEED half of it is left; what is taken back fades with the time ahead.
    """
    fine = scratch[_OUT] / (1.0 + (speed_sigma / _KNOWN_SPEED) ** 2)
    for knot in range(K):
        scratch[_OUT + knot] -= fine * math.exp(-KNOTS[knot] / _FADES)


@njit
def integrate_rows(step, out):
    """Rewrite positions and headings of `out` ((R, 8)) from its first pose and every row's speed and turn rate."""
    for k in range(1, out.shape[0]):
        a, b = out[k - 1], out[k]
        turn = 0.5 * step * (a[5] + b[5])
        half = 0.5 * turn
        chord = 0.5 * step * (a[4] + b[4]) * (1.0 - half * half / 6.0)
        b[0] = a[0] + chord * math.cos(a[3] + half)
        b[1] = a[1] + chord * math.sin(a[3] + half)
        b[3] = a[3] + turn


@njit
def predict_learned(history, t, x, sigma, speed_sigma, age, streak, step, net, scratch, most, future):
    """Bend `future` ((R, 8), already filled by an analytic prediction) to what the network expects.

    `history` row; `t` s; `x` (8,): the filter's own row now; `sigma`, `speed_sigma`, `age`, `streak`
    as in an estimate row; `net` (NET_DIM,), `scratch` (SCRATCH_DIM,) float32; `most` 0..1: how far its speeds are
    trusted if all else is well. Returns (trust 0..1, expected rms error of the speed over the next 0.7 s, m/s); at
    trust 0 `future` is left alone and the error is meaningless.
    """
    trust = predictor_gate(net, history, age)
    if trust <= 0.0:
        return 0.0, 0.0
    predictor_inputs(history, t, x, sigma, speed_sigma, age, streak, scratch)
    predictor_network(net, scratch)
    believe_filter(speed_sigma, scratch)
    knot = 0
    for k in range(future.shape[0]):
        ahead = k * step
        while knot < K - 2 and ahead > KNOTS[knot + 1]:
            knot += 1
        s = min(1.0, (ahead - KNOTS[knot]) / (KNOTS[knot + 1] - KNOTS[knot]))
        speed, turn = base_motion(x[4], x[5], x[7], ahead)
        speed += (1.0 - s) * scratch[_OUT + knot] + s * scratch[_OUT + knot + 1]
        turn += (1.0 - s) * scratch[_OUT + K + knot] + s * scratch[_OUT + K + knot + 1]
        row = future[k]
        row[4] += most * trust * (min(4.0, max(-4.0, speed)) - row[4])
        row[5] += trust * (min(2.5, max(-2.5, turn)) - row[5])
    integrate_rows(step, future)
    return trust, math.exp(min(1.0, max(-5.0, scratch[SCRATCH_DIM - 1])))


def interpolation(rows: int = HORIZON, step: float = STEP) -> np.ndarray:
    """(K, rows) matrix that takes values at KNOTS to values at the rows, as `predict_learned` does."""
    out = np.zeros((K, rows))
    for k, ahead in enumerate(np.arange(rows) * step):
        i = min(K - 2, max(0, int(np.searchsorted(KNOTS, ahead)) - 1))
        s = min(1.0, (ahead - KNOTS[i]) / (KNOTS[i + 1] - KNOTS[i]))
        out[i, k], out[i + 1, k] = 1.0 - s, s
    return out


def pack_network(
    layers: list[tuple[np.ndarray, np.ndarray]], gate: tuple[float, float, float, float, float]
) -> np.ndarray:
    """The (NET_DIM,) float32 row of three (weights (in, out), bias) pairs and the gate. Raises ValueError."""
    shapes = [(INPUTS, HIDDEN1), (HIDDEN1, HIDDEN2), (HIDDEN2, OUTPUTS)]
    if [w.shape for w, _ in layers] != shapes or [b.shape for _, b in layers] != [(n,) for _, n in shapes]:
        raise ValueError(f"a predictor needs layers of {shapes}, not {[w.shape for w, _ in layers]}")
    if not (0.0 <= gate[0] < gate[1] and 0.0 <= gate[2] < gate[3] and 0.0 <= gate[4] <= 1.0):
        raise ValueError(f"the predictor's gate is {gate}: it must rise with history and fall with age")
    row = np.concatenate([part.ravel() for pair in layers for part in pair] + [np.array(gate)]).astype(np.float32)
    if not np.isfinite(row).all():
        raise ValueError("the predictor's weights are not all finite")
    return row


def save_predictor(path: Path, net: np.ndarray, note: str) -> None:
    """Write a predictor with a note of where it comes from."""
    np.savez_compressed(path, version=VERSION, knots=np.array(KNOTS), net=net, note=note)


def load_predictor(path: Path = CHECKPOINT) -> np.ndarray:
    """The (NET_DIM,) float32 row. Raises FileNotFoundError, or ValueError for a file of another version or corrupt."""
    if not path.exists():
        raise FileNotFoundError(
            f"no motion predictor at {path}: train one with python -m policies.prediction.learned_training"
        )
    try:
        with np.load(path, allow_pickle=False) as data:
            version, knots, net = int(data["version"]), data["knots"], data["net"]
    except Exception as error:
        raise ValueError(f"{path} is no motion predictor: {error}") from error
    if version != VERSION or net.shape != (NET_DIM,) or knots.shape != (K,) or not np.allclose(knots, KNOTS):
        raise ValueError(f"{path} is a motion predictor of version {version}, this is {VERSION}: train it again")
    if net.dtype != np.float32 or not np.isfinite(net).all():
        raise ValueError(f"{path}: the motion predictor's weights are not finite 32-bit numbers")
    return net
