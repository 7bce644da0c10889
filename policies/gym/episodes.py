"""What both Gymnasium environments share: seeds, steps without copies, how an episode ended."""

from __future__ import annotations

from typing import Any

import numpy as np

from kernel.random import stream
from policies.environment import ended_row
from policies.environment.env import Env, advance
from policies.task import result_row
from policies.task.contact import REASONS, SUCCESS

# What `info` has of an ended episode, and where it is kept. m, rad, m/s; the normal speed is negative into the board.
MEASURES: dict[str, int] = {
    "planar": result_row.PLANAR,
    "normal_error": result_row.NORMAL_ERROR,
    "normal_speed": result_row.NORMAL_SPEED,
    "tangential_speed": result_row.TANGENTIAL_SPEED,
}


def begin(env: Env, seed: int | None) -> np.ndarray:
    """Begin a new episode in every row; returns the observations, (N, OBS_DIM) float32, newly allocated.

    `seed`: each row gets the random stream that EnvConfig(seed=`seed`) gives it; None: the streams go on.
    """
    if seed is not None:
        env.rows.rng[:] = [stream(seed, row) for row in range(env.config.count)]
    _take_new_memory(env)
    return env.reset()


def step(env: Env, actions: np.ndarray) -> np.ndarray:
    """One control step of every row; returns the observations, (N, OBS_DIM) float32, newly allocated.

    A row whose episode ends begins the next one in the same step. Raises ValueError if an action is not finite or
    their shape is not (N, 4).
    """
    actions = np.asarray(actions)
    if actions.shape != (env.config.count, 4):
        raise ValueError(f"actions have the shape {actions.shape}; it must be {(env.config.count, 4)}")
    _take_new_memory(env)
    advance(env.rows, env.shared, actions)
    return env.rows.observation


def ended(env: Env, rows: np.ndarray) -> dict[str, Any]:
    """How the last episodes of `rows` ((K,) indices) ended: a name -> (K,) array.

    `is_success`: the paper's tolerances were kept (Algorithm 1); `attached`: the magnet held; `cause`: "success" or the
    reason of the failure; `steps` of 10 ms; and MEASURES at contact.
    """
    kept = env.rows.ended[rows]
    success = kept[:, result_row.OUTCOME] == SUCCESS
    causes = [REASONS[int(reason)] for reason in kept[:, result_row.REASON]]
    return {
        "is_success": success,
        "attached": kept[:, result_row.ATTACHED] > 0.0,
        "cause": np.array(["success" if good else why for good, why in zip(success, causes, strict=True)], object),
        "steps": kept[:, ended_row.STEPS].astype(np.int64),
        **{name: kept[:, index] for name, index in MEASURES.items()},
    }


def _take_new_memory(env: Env) -> None:
    """Have the next observations written into a new array: a caller keeps those that it got."""
    env.rows = env.rows._replace(observation=np.empty_like(env.rows.observation))
