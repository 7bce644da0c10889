"""Recipes: environment, network and phases of learning of a policy, as TOML files in `recipes/`."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from kernel.toml_errors import ConfigError, read_toml, validate
from policies.environment.config import EnvConfig
from policies.network.actor_critic import NetworkConfig
from policies.task.contact import ContactRules
from policies.task.observation import LAYOUT_NAME, LAYOUT_VERSION
from policies.task.reward import RewardWeights
from policies.training.learners.dagger import Dagger, DaggerConfig
from policies.training.learners.ppo import Ppo, PpoConfig

FOLDER = Path(__file__).with_name("recipes")
LAYOUT = f"{LAYOUT_NAME} {LAYOUT_VERSION}"
_PHASES = {Dagger.name: DaggerConfig, Ppo.name: PpoConfig}
_SCALED = ("samples", "teacher_fade", "critic_only")  # settings of a phase that `budget` multiplies
_SECTIONS = ("env", "weights", "rules", "network")

T = TypeVar("T")


class RecipeError(ValueError):
    """A recipe that cannot be used, with file, key and what is wrong in one line."""


class Phase(BaseModel):
    """One phase of learning: its settings, and what it changes in the environment, the rules and the reward."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str
    settings: dict[str, Any] = Field(default_factory=dict)
    env: dict[str, Any] = Field(default_factory=dict)
    rules: dict[str, Any] = Field(default_factory=dict)
    weights: dict[str, Any] = Field(default_factory=dict)


class Recipe(BaseModel):
    """A recipe file. `env`, `weights`, `rules`, `network` override defaults; `budget` multiplies every phase's samples.

    `layout`: name and version of the observation that its settings are meant for.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    title: str
    layout: str = LAYOUT
    budget: float = Field(default=1.0, gt=0.0)
    env: dict[str, Any] = Field(default_factory=dict)
    weights: dict[str, Any] = Field(default_factory=dict)
    rules: dict[str, Any] = Field(default_factory=dict)
    network: dict[str, Any] = Field(default_factory=dict)
    phase: list[Phase] = Field(min_length=1)

    def env_config(self, stage: str, seed: int, phase: Phase | None = None) -> EnvConfig:
        """The environment of a stage, as changed by a phase. Raises RecipeError."""
        changes = {**self.env, **(phase.env if phase else {})}
        rules = {**self.rules, **(phase.rules if phase else {})}
        weights = {**self.weights, **(phase.weights if phase else {})}
        config = _override(EnvConfig(stage=stage, seed=seed), changes, f"recipe {self.name}: env")
        return replace(
            config,
            weights=_override(RewardWeights(), weights, f"recipe {self.name}: weights"),
            rules=_override(ContactRules(), rules, f"recipe {self.name}: rules"),
        )

    def network_config(self) -> NetworkConfig:
        """The network. Raises RecipeError."""
        return _override(NetworkConfig(), self.network, f"recipe {self.name}: network")

    def phase_config(self, phase: Phase) -> DaggerConfig | PpoConfig:
        """The settings of a phase, within the budget. Raises RecipeError."""
        if phase.kind not in _PHASES:
            raise RecipeError(f"recipe {self.name}: phase kind '{phase.kind}' is not one of {', '.join(_PHASES)}")
        config = _override(_PHASES[phase.kind](), phase.settings, f"recipe {self.name}: {phase.kind}")
        scaled = {k: round(self.budget * getattr(config, k)) for k in _SCALED if hasattr(config, k)}
        return replace(config, **scaled)

    def changed(self, changes: Sequence[str]) -> Recipe:
        """The recipe with settings changed, `SECTION.KEY=VALUE` or `budget=VALUE`, values as in TOML.

        Raises RecipeError.
        """
        data = self.model_dump()
        for change in changes:
            where, equals, text = change.partition("=")
            section, dot, key = where.strip().partition(".")
            try:
                value = tomllib.loads(f"value = {text}")["value"]
            except (ValueError, RecursionError):  # tomllib's, also for a number of thousands of digits
                value = text.strip()
            known = section in _SECTIONS if dot else section == "budget"
            if not equals or not known:
                raise RecipeError(f"'{change}': give budget=VALUE or SECTION.KEY=VALUE of {', '.join(_SECTIONS)}")
            data = {**data, section: {**data[section], key: value} if dot else value}
        return _checked(data, f"recipe {self.name}")


_MOST = 2.0**63  # of any number of a recipe


def _override(config: T, changes: dict[str, Any], where: str) -> T:
    known = {item.name for item in fields(config)}  # type: ignore[arg-type]
    for key, value in changes.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)
            raise RecipeError(f"{where} has no setting '{key}'" + (f"; did you mean '{near[0]}'?" if near else ""))
        old = getattr(config, key)
        if not _fits(old, value):
            raise RecipeError(f"{where}.{key} is {value!r}; it should look like {old!r}")
        changes = {**changes, key: _like(old, value)}
    try:
        return replace(config, **changes)  # type: ignore[type-var]
    except ValueError as error:
        raise RecipeError(f"{where}: {error}") from None
    except (IndexError, TypeError) as error:  # of a list
        raise RecipeError(f"{where}: a list has another length or kind than its default: {error}") from None


def _fits(old: Any, value: Any) -> bool:
    if isinstance(old, tuple):
        return isinstance(value, list | tuple)
    if isinstance(old, bool | str):
        return type(value) is type(old)
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < _MOST:  # also no NaN
        return False
    return isinstance(old, float) or float(value).is_integer()


def _like(old: Any, value: Any) -> Any:
    if isinstance(old, tuple):
        return tuple(value)
    if isinstance(old, bool | str):
        return value
    return type(old)(value)


def list_recipes() -> list[str]:
    """Names of the recipes that come with the project."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_recipe(name: str | Path) -> Recipe:
    """The recipe of that name, or of the TOML file at that path. Raises RecipeError."""
    path = Path(name)
    if path.suffix != ".toml":
        path = FOLDER / f"{name}.toml"
        if not path.exists():
            near = difflib.get_close_matches(str(name), list_recipes(), 1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            raise RecipeError(f"there is no recipe '{name}': known are {', '.join(list_recipes())}{hint}")
    try:
        data = {"name": path.stem, **read_toml(path)}
    except ConfigError as error:
        raise RecipeError(str(error)) from None
    return _checked(data, str(path))


def _checked(data: dict[str, Any], where: str) -> Recipe:
    """A recipe of which every setting is known to fit. Raises RecipeError."""
    try:
        recipe = validate(data, Recipe, where)
    except ConfigError as error:
        raise RecipeError(str(error)) from None
    if recipe.layout != LAYOUT:
        raise RecipeError(f"{where}: made for observation layout {recipe.layout}, this version has {LAYOUT}")
    for phase in recipe.phase:
        recipe.phase_config(phase)
        recipe.env_config("state", 0, phase)
        recipe.env_config("vision", 0, phase)
    recipe.network_config()
    return recipe
