"""The interface of a learner to a training run."""

from __future__ import annotations

from typing import ClassVar, Protocol

from policies.environment.env import Env
from policies.network.actor_critic import Actor


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
        """Numbers of the iteration; always `samples` (so far), `episodes` (that ended) and `success` (their share, 0 to
        1, NaN if there were none)."""
        ...

    def state(self) -> dict:
        """All that a resumed run needs, on whatever device it goes on."""
        ...

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        ...
