"""Flights for policy search: up to where they are decided, and from there to their ends, as often as is wanted.

What tells one policy from another happens near the board. So the way there is flown once, and rows that have come near
are kept as they are: a copy of an episode's row is that episode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from groundcar.motion import board_row
from kernel.random import stream
from policies.environment.env import Env, advance
from policies.environment.rows import S_STEP, Rows, Shared
from vehicle.quadrotor import state_row

Act = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Observations ((n, OBS_DIM)) and which episodes they are of ((n,) int) in, actions ((n, 4)) out."""

_WORTH_IT = 0.75  # share still flying below which the others are left behind
STRAIGHT = 0.1  # rad/s, a board that hardly turns
_LEAST = 0.12  # share of the flights over such boards


def copy_rows(rows: Rows, which: np.ndarray) -> Rows:
    """Those rows (indices or a mask) of an environment, as rows of their own."""
    return Rows(*(array[which] for array in rows))


def fly_near(env: Env, act: Act, near: float) -> tuple[Rows, int]:
    """Begin an episode in every row and fly it until the board's centre is within `near` m of the drone.

    Returns copies of the rows at that moment, without those of episodes that ended before, and the steps flown. Raises
    ValueError if an action is not finite.
    """
    env.reset()
    kept = copy_rows(env.rows, np.arange(env.config.count))
    arrived = np.zeros(env.config.count, dtype=bool)

    def look(rows: Rows, which: np.ndarray, flying: np.ndarray) -> None:
        board = rows.track[np.arange(len(which)), rows.state[:, S_STEP].astype(np.int64), :3]
        reached = flying & (np.linalg.norm(board - rows.vehicle[:, state_row.P : state_row.P + 3], axis=1) < near)
        for mine, theirs in zip(kept, rows, strict=True):
            mine[which[reached]] = theirs[reached]
        arrived[which[reached]] = True
        flying &= ~reached

    steps = _fly(env.rows, env.shared, act, look)
    return copy_rows(kept, arrived), steps


def rather_turning(rows: Rows, turning: float, rng: np.random.Generator) -> Rows:
    """All rows whose board turns by `turning` rad/s or more, and fewer of the others the less theirs does.

    One in eight or so of those straight ahead is kept; all are if that would leave none.
    """
    here = np.arange(len(rows.done)), rows.state[:, S_STEP].astype(np.int64)
    share = (np.abs(rows.track[here][:, board_row.TURN_RATE]) - STRAIGHT) / (turning - STRAIGHT)
    kept = rng.random(len(rows.done)) < np.clip(share, _LEAST, 1.0)
    return copy_rows(rows, kept) if kept.any() else rows


def fly_out(start: Rows, shared: Shared, act: Act, seeds: Sequence[int]) -> tuple[np.ndarray, int]:
    """Fly every row of `start`, which stays as it is, to its end, once for each of `seeds` of all chance from there.

    Returns the ended rows (see env_rows), those of the first seed first, and the steps flown. Episodes are numbered
    likewise. Raises ValueError if an action is not finite.
    """
    count = len(start.done)
    rows = copy_rows(start, np.tile(np.arange(count), len(seeds)))
    rows.rng[:] = np.concatenate([[stream(seed, i) for i in range(count)] for seed in seeds])
    ended = np.zeros_like(rows.ended)

    def look(rows: Rows, which: np.ndarray, flying: np.ndarray) -> None:
        done = flying & (rows.done > 0)
        ended[which[done]] = rows.ended[done]

    return ended, _fly(rows, shared, act, look)


def _fly(rows: Rows, shared: Shared, act: Act, look: Callable[[Rows, np.ndarray, np.ndarray], None]) -> int:
    """Step `rows` until none is `flying` any more, and return the steps flown. Who has ended is left behind.

    `look` sees them (rows, which, flying) before each step and after the last, and may land some.
    """
    which, steps = np.arange(len(rows.done)), 0
    flying = np.ones(len(which), dtype=bool)
    rows.done[:] = 0
    while True:
        look(rows, which, flying)
        flying &= rows.done == 0
        if not flying.any():
            return steps
        if flying.mean() < _WORTH_IT:
            rows, which, flying = copy_rows(rows, flying), which[flying], flying[flying]
        advance(rows, shared, act(rows.observation, which))
        steps += len(which)
