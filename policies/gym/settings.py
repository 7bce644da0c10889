"""The keywords of `gymnasium.make` as settings of the training environment."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from kernel.toml_errors import nearest
from policies.environment.config import EnvConfig
from policies.environment.env import Env

_OURS = ("count", "seed")  # given by num_envs and reset(seed=...)


def settings(count: int, stage: str, airframe: str, more: dict[str, Any]) -> EnvConfig:
    """The settings of `count` episodes side by side; `more` has further fields of EnvConfig by name.

    A list (as an EnvSpec read from JSON has it) stands for a tuple. Raises ValueError for an unknown name, a value out
    of range and an unknown airframe.
    """
    known = [field.name for field in fields(EnvConfig) if field.name not in (*_OURS, "stage", "airframe")]
    for name in more:
        if name in _OURS:
            raise ValueError(f"setting {name} is given otherwise: num_envs, and reset(seed=...)")
        if name not in known:
            raise ValueError(f'the environment has no setting "{name}"{nearest(name, known)}')
    values: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in more.items()}
    return EnvConfig(stage=stage, count=count, airframe=airframe, **values)


def environment(count: int, stage: str, airframe: str, more: dict[str, Any]) -> Env:
    """The compiled environment with these settings; raises as `settings`."""
    return Env(settings(count, stage, airframe, more))
