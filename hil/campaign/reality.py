"""Does the simulator tell the truth: a recorded run against its twin, flown on the same board motion and commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import bootstrap

from hil.assembly.rig import Rig
from hil.assembly.twin import simulated_twin
from hil.campaign.playback import Playback
from hil.campaign.quantities import Attempt, Quantity, quantities
from hil.campaign.refly import scenario_again
from hil.host.flight import fly
from hil.recording.provenance import Code
from hil.recording.reader import ReadError, Recording
from hil.recording.runs import Run
from kernel.toml_errors import ConfigError

POLICY = "recorded"  # what flies in a twin
_MARGIN_S = 0.5


@dataclass(frozen=True)
class Difference:
    """One quantity: its median in the recorded runs and in their twins, and their distance with its interval. None:
    not known."""

    name: str
    unit: str
    real: float | None
    twin: float | None
    distance: float | None
    low: float | None
    high: float | None
    samples: tuple[int, int]

    @property
    def differs(self) -> bool:
        """Whether the interval leaves 0 out."""
        return self.low is not None and self.high is not None and not self.low <= 0.0 <= self.high


def fly_twin(run: Run, out: Path, code: Code, seed: int = 0, source: str = "any") -> Run:
    """Fly the twin of `run`. Raises ConfigError for a run that cannot be flown again, and what `fly` raises."""
    try:
        attempt = Attempt(Recording(run.recording))
        rig = simulated_twin(Rig.model_validate({k: v for k, v in run.manifest["rig"].items() if k != "name"}))
    except (ReadError, ValueError, KeyError) as error:
        raise ConfigError(f"{run.path}: cannot be flown again: {error}") from None
    sent = [m for _, m in attempt.messages["vehicle/sent"] if m.stamp_ns >= attempt.start_ns > 0]
    try:
        policy = Playback([(m.stamp_ns - attempt.start_ns, m.body_rate, m.thrust) for m in sent])
    except ValueError as error:
        raise ConfigError(f"{run.path}: cannot be flown again: {error}") from None
    scenario = scenario_again(run, source)
    lasted = (attempt.end_ns - attempt.start_ns) * 1e-9 + _MARGIN_S
    scenario = scenario.model_copy(update={"time_limit": lasted})
    flight = fly(
        scenario, rig, policy, seed, policy_name=POLICY, rig_name="twin", pictures="none", out=out, code=code,
        progress=lambda *_: None, clearance={"kind": "simulated"},
    )  # fmt: skip
    return flight.run


def measured(run: Run) -> list[Quantity]:
    """The quantities of one run. Raises ConfigError for a recording that cannot be read."""
    try:
        return quantities(Attempt(Recording(run.recording)))
    except ReadError as error:
        raise ConfigError(str(error)) from None


def compare(
    real: Sequence[Sequence[Quantity]], twins: Sequence[Sequence[Quantity]], confidence: float = 0.95
) -> list[Difference]:
    """What differs, quantity by quantity; the samples of all runs together."""
    found = []
    for columns in zip(zip(*real, strict=True), zip(*twins, strict=True), strict=True):
        a, b = (np.concatenate([np.asarray(one.samples, float) for one in side]) for side in columns)
        first = columns[0][0]
        found.append(_difference(first.name, first.unit, a[np.isfinite(a)], b[np.isfinite(b)], confidence))
    return found


def _difference(name: str, unit: str, a: np.ndarray, b: np.ndarray, confidence: float) -> Difference:
    middle = np.mean if name.startswith("detection rate") else np.median
    real, twin = (float(middle(one)) if len(one) else None for one in (a, b))
    distance = real - twin if real is not None and twin is not None else None
    low = high = None
    if distance is not None and min(len(a), len(b)) >= 3:
        if np.ptp(a) == 0.0 and np.ptp(b) == 0.0:
            low = high = distance
        else:
            interval = bootstrap(
                (a, b), lambda x, y, axis=-1: middle(x, axis=axis) - middle(y, axis=axis), n_resamples=999,
                confidence_level=confidence, method="percentile", vectorized=True, rng=np.random.default_rng(0),
            ).confidence_interval  # fmt: skip
            low, high = float(interval.low), float(interval.high)
    return Difference(name, unit, real, twin, distance, low, high, (len(a), len(b)))


def as_rows(differences: Sequence[Difference]) -> list[dict[str, Any]]:
    """For JSON and for the page."""
    return [{**one.__dict__, "differs": one.differs} for one in differences]
