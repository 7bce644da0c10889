"""Makes policies/flying/observations.npz: what the shipped network observes in flights of every published scenario.

    python -m tests.unit.policies.flying.record_observations

To be run again when the layout of observations changes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hil.assembly.rig import load_rig
from hil.host.flight import fly
from hil.recording import provenance
from policies.flying.guided import GuidedPolicy
from policies.flying.onnx_file import OpenedPolicy, open_policy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.trial import OBSERVATIONS, STRIDE
from policies.task.observation import LAYOUT_NAME, LAYOUT_VERSION
from scenarios.spec import list_scenarios, load
from tests.paths import ROOT
from vehicle.quadrotor.airframe import load_airframe

FILE = ROOT / "policies" / "checkpoints" / "vision.onnx"
SEED = 0
EACH = 40  # observations of a flight, evenly from the first to the last


class Kept(OpenedPolicy):
    """A network that keeps what it observes."""

    def run(self, observations: Any) -> Any:
        seen.append(observations[0].copy())
        return super().run(observations)


seen: list[np.ndarray] = []


def observed(scenario: str, out: Path) -> np.ndarray:
    """(EACH, OBS_DIM) observations of one flight."""
    rig = load_rig("sim")
    rig = rig.model_copy(update={"camera": rig.camera.model_copy(update={"source": "model"})})
    airframe, network = load_airframe(rig.vehicle.airframe), open_policy(FILE)
    assert network.contract.observation.stride == STRIDE
    policy = OnnxPolicy(Kept(*network), airframe)
    seen.clear()
    flight = fly(
        load(scenario), rig, GuidedPolicy(policy, airframe) if network.contract.guidance else policy, SEED,
        policy_name="vision", rig_name="sim", pictures="none", out=out, code=provenance.code(),
        progress=lambda now_ns, stage: None,
    )  # fmt: skip
    print(f"{scenario}: {len(seen)} observations, {flight.score.verdict}")
    return np.array([seen[i] for i in np.linspace(0, len(seen) - 1, EACH).round().astype(int)])


def main() -> None:
    with tempfile.TemporaryDirectory() as out:
        found = np.concatenate([observed(name, Path(out)) for name in list_scenarios() if load(name).published])
    np.savez_compressed(OBSERVATIONS, layout=LAYOUT_NAME, version=LAYOUT_VERSION, observations=found)
    print(f"{OBSERVATIONS}: {found.shape}, {OBSERVATIONS.stat().st_size} bytes")


if __name__ == "__main__":
    main()
