"""Cases of a policy's evaluation, as a worker flies them in the training environment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from hil.campaign.workers.work import Place
from policies.evaluation.contenders import Contender, open_contender
from policies.evaluation.evaluate import Case, Row, fly_case
from policies.flying.shipped import SHIPPED, policy_file


@dataclass(frozen=True)
class Evaluating:
    """`Work`: flies cases with one policy; it leaves no runs. `policy`: as `open_contender` takes it; `noise`: one of
    NOISES."""

    policy: str
    noise: str
    out: Path = Path()

    @property
    def files(self) -> dict[str, Path]:
        """See `Work.files`."""
        file = None if self.policy in SHIPPED else policy_file(self.policy)
        return {self.policy: file} if file else {}

    def __call__(self, case: Case, place: Place) -> Row:
        return fly_case(_contender(place.file(self.policy)).policy, case, self.noise)


@lru_cache(maxsize=8)
def _contender(name: str) -> Contender:
    return open_contender(name)
