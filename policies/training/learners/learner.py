"""The interface of a learner to a training run."""

from __future__ import annotations

import math
from typing import ClassVar, Protocol

import numpy as np

from policies.environment import ended_row
from policies.environment.env import Env
from policies.network.actor_critic import Actor
from policies.task import result_row
from policies.task.contact import SUCCESS


class Learner(Protocol):
    """`step` is one iteration: collect, learn, report. `average` is the actor that is exported."""

    name: ClassVar[str]
    env: Env
    actor: Actor
    average: Actor
    samples: int

    @property
    def finished(self) -> bool: ...

    def step(self) -> dict[str, float]:
        """Numbers of the iteration; always `samples` (so far) and those of `take_episodes`."""
        ...

    def state(self) -> dict:
        """All that a resumed run needs, on whatever device it goes on."""
        ...

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        ...


def take_episodes(env: Env) -> tuple[np.ndarray, dict[str, float]]:
    """The episodes that ended since the last call ((K, ended_row.DIM)), and in numbers: `episodes`, the share of
    `success` (0 to 1) and the mean `rho` (paper, figure of the vision ablations); both NaN if there were none."""
    rows = env.tally.rows
    env.tally.__init__()
    success = float((rows[:, result_row.OUTCOME] == SUCCESS).mean()) if len(rows) else math.nan
    rho = float(rows[:, ended_row.RHO].mean()) if len(rows) else math.nan
    return rows, {"episodes": len(rows), "success": success, "rho": rho}
