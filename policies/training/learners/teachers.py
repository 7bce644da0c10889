"""The teachers of imitation learning, by name; each gives labels on the learner's device."""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor

from policies.environment.env import Env
from policies.teachers.planner import PlannerTeacher
from policies.teachers.teacher import Teacher
from policies.training.learners.teacher_network import NetworkTeacher

_IGNORED = 0.045  # s before a plan's contact without labels: its commands end with a plan that the student does not see


class Labels(Protocol):
    """A teacher as imitation uses it."""

    def act(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Labels (N, 4) in [-1, 1], and (N,) 1 where they may be learnt from, 0 elsewhere."""
        ...

    def state(self) -> dict: ...

    def load(self, state: dict) -> None: ...


def open_teacher(name: str, env: Env, device: torch.device) -> Labels:
    """The teacher `expert` (privileged information: the board's future and the true gain), `planner` (it receives what
    the student receives), or an exported policy (`NetworkTeacher`). Raises TrainingError for one that does not fit."""
    if name == "expert":
        return _Planned(Teacher(env), device)
    if name == "planner":
        return _Planned(PlannerTeacher(env), device)
    return NetworkTeacher(env, name, device)


class _Planned:
    """A teacher that plans on the host, on the environment's rows."""

    def __init__(self, teacher: Teacher | PlannerTeacher, device: torch.device) -> None:
        self._teacher, self._device = teacher, device
        self.state, self.load = teacher.state, teacher.load

    def act(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        label = torch.from_numpy(self._teacher.act()).float().to(self._device)
        return label, torch.from_numpy(self._teacher.remaining > _IGNORED).to(self._device)
