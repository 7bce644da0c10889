"""The planner's parameters: a checked dataclass, and their row for kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from policies.planner.groups import (
    Commit,
    Contact,
    Follow,
    Glide,
    Prediction,
    RunUp,
    Search,
    Terminal,
    Tracking,
    Vehicle,
    Weights,
)

STEEP: dict[str, float] = {
    "contact.speed": 0.85,
    "contact.speed_by_sigma": 0.0,
    "contact.skid": 0.0,
    "contact.overshoot": -0.012,
    "contact.overshoot_by_acceleration": 0.035,
    "contact.flatten": 0.0,
    "contact.aim": 0.7,
    "terminal.speed": 0.65,
    "search.duration_min": 0.64,
    "search.thrust_max": 17.8,
    "search.period": 0.025,
    "search.freeze": 0.278,
    "search.blind": 0.52,
    "weights.time": 0.64,
    "weights.postpone": 10.6,
    "weights.thrust": 2.8,
    "weights.rate": 10.6,
    "weights.visibility": 0.64,
    "weights.force": 0.03,
    "prediction.acceleration_tau": 0.8,
    "prediction.trust": 0.6,
    "commit.speed_sigma": 0.25,
    "commit.age": 0.15,
    "commit.surprise": 0.15,
    "commit.relax_after": 3.46,
    "commit.relax_surprise": 0.3,
    "commit.lost_age": 1.05,
    "follow.distance": 2.4,
    "follow.elevation": 0.244,
    "follow.kv": 6.0,
    "follow.speed": 3.2,
    "follow.tilt": 1.06,
    "follow.yaw_k": 2.5,
    "tracking.fade": 0.2,
    "tracking.kp": 3.8,
    "tracking.kv": 9.4,
    "run_up.coast": 0.35,
}
"""What differs over boards that take a run-up: path of the field -> value."""

_SIGNED = ("contact.overshoot", "contact.lean", "vehicle.camera_tilt")


@dataclass(frozen=True)
class PlannerParams:
    """Limits, weights and rules of the planner, in groups (see `groups.py`). A field's path is "group.field".

    `steep` (path -> value) is put over the other values on boards that take a run-up. Raises ValueError, which names
    the path, for a value that is not finite or negative where that has no meaning, and for a path that does not exist.
    """

    vehicle: Vehicle
    contact: Contact = field(default_factory=Contact)
    terminal: Terminal = field(default_factory=Terminal)
    search: Search = field(default_factory=Search)
    weights: Weights = field(default_factory=Weights)
    prediction: Prediction = field(default_factory=Prediction)
    commit: Commit = field(default_factory=Commit)
    follow: Follow = field(default_factory=Follow)
    tracking: Tracking = field(default_factory=Tracking)
    run_up: RunUp = field(default_factory=RunUp)
    glide: Glide = field(default_factory=Glide)
    steep: Mapping[str, float] = field(default_factory=lambda: dict(STEEP))

    def __post_init__(self) -> None:
        _known(self.steep, self.values())
        for values in (self.values(), self.steep_values()):
            _check(values)

    def values(self) -> dict[str, float]:
        """Path -> value, in the order of the row."""
        groups = {name: group for name, group in asdict(self).items() if name != "steep"}
        return {f"{name}.{key}": value for name, group in groups.items() for key, value in group.items()}

    def steep_values(self) -> dict[str, float]:
        """`values` with `steep` put over them."""
        return {**self.values(), **self.steep}

    def changed(self, values: Mapping[str, float], steep: Mapping[str, float] | None = None) -> PlannerParams:
        """A copy with other `values` (by path), and with those of `steep` added to its own. Raises as the class."""
        _known(values, self.values())
        groups = {
            name: replace(
                getattr(self, name),
                **{path.partition(".")[2]: values[path] for path in values if path.startswith(f"{name}.")},
            )
            for name in {path.partition(".")[0] for path in values}
        }
        return replace(self, **groups, steep={**self.steep, **(steep or {})})

    def row(self) -> np.ndarray:
        """The row for kernels ((2 * params_row.COUNT,)): the parameters, then those for steep boards."""
        return np.array([*self.values().values(), *self.steep_values().values()], dtype=np.float64)


def _known(paths: Mapping[str, float], known: Mapping[str, float]) -> None:
    unknown = sorted(set(paths) - set(known))
    if unknown:
        raise ValueError(f"planner parameters that do not exist: {', '.join(unknown)}")


def _check(values: Mapping[str, float]) -> None:
    for path, value in values.items():
        if not math.isfinite(value) or (value < 0.0 and path not in _SIGNED):
            raise ValueError(f"planner parameter {path} is {value}; give a finite number that is not negative")
    for low, high in (("search.duration_min", "search.duration_max"), ("search.thrust_min", "search.thrust_max")):
        if not 0.0 < values[low] <= values[high]:
            raise ValueError(f"planner parameters need 0 < {low} <= {high}")
    if values["vehicle.thrust_min"] >= values["vehicle.thrust_max"] or values["search.period"] <= 0.0:
        raise ValueError("planner parameters need vehicle.thrust_min < vehicle.thrust_max and search.period > 0")
