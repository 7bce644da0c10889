"""A short made-up flight as recorded messages, for the tests of everything that reads recordings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from hil.contract import messages as m
from hil.recording.foxglove import FoxgloveView, belief_orientation
from hil.recording.recorder import Recorder

PICTURE = np.kron(np.arange(12 * 16, dtype=np.uint8).reshape(12, 16), np.ones((60, 80), np.uint8)).tobytes()
LEVEL = (1.0, 0.0, 0.0, 0.0)


def flight(seconds: float = 3.0, offset: float = 0.0):
    """(now_ns, topic, message) of a flight; `offset` (m) shifts the believed position from one second on."""
    for step in range(int(seconds * 100)):
        t = step * 10_000_000
        s = t / 1e9
        board = (2.0 + s, 0.0, 1.5)
        tilted = belief_orientation(0.1 * s, math.radians(70))
        yield t, "truth/vehicle", m.VehicleState(t, (s, 0.0, 2.5), (1.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.1))
        yield t, "mocap/vehicle", m.VehicleState(t, (s, 0.0, 2.5), (1.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.1))
        yield t, "truth/board", m.BoardState(t, board, (1.0, 0.0, 0.0), tilted, 0.1 * s, 1.0, 0.1)
        shifted = (board[0] + (offset if s >= 1.0 else 0.0), *board[1:])
        yield (
            t,
            "belief",
            m.Belief(t, s > 0.5, shifted, 0.1 * s, 1.0, 0.1, 1.2, 0.9, t, step, 0, (0.1,) * 7, 0.2, 3, 0.0),
        )
        if step % 2 == 0:
            yield t, "camera/image", m.Image(t, 1280, 720, 2_000_000, PICTURE, step)
            yield t, "board/detection", m.Detection(t, True, board, tilted, 0.01, 0.02, (0,), (1.0, 2.0), "", step, 5)
    end = int(seconds * 1e9)
    yield end, "event", m.Event(end, "warning", "director", "the end")


def record(path: Path, *, pictures: str = "none", seconds: float = 3.0, offset: float = 0.0) -> Path:
    """Record `flight` to `path` and return it."""
    with Recorder(path, view=FoxgloveView(pictures=pictures), metadata={"scenario": "hard-i"}) as recorder:
        for entry in flight(seconds, offset):
            recorder(*entry)
    return path
