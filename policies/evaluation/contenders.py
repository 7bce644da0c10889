"""What can be evaluated, by name: networks, planners, the expert on privileged information, Fast-Perching."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from policies.baselines.fast_perching_policy import FastPerching
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.evaluation.evaluate import Policy
from policies.flying.contract import check_contract
from policies.flying.onnx_file import open_policy
from policies.flying.shipped import PLANNERS, SHIPPED, policy_file
from policies.flying.trial import try_policy
from policies.planner.policy import GUIDANCE
from policies.teachers.planner import ANALYTIC, LEARNED, PlannerInEnv
from policies.teachers.teacher import Teacher

NAMES = (*SHIPPED, *PLANNERS, "expert", "fast-perching", "fast-perching-ctrv")


class OnnxPolicy:
    """An exported policy as an `evaluate.Policy`: what flies, on the training's environment. Raises ContractError."""

    def __init__(self, path: str | Path) -> None:
        self.network = open_policy(path)
        check_contract(self.network.contract)
        try_policy(self.network)

    def __call__(self, env: Env) -> np.ndarray:
        return self.network.run(env.rows.observation)


class Expert:
    """The expert teacher flying on privileged information: an upper bound, not a policy."""

    def __init__(self) -> None:
        self._env: Env | None = None

    def __call__(self, env: Env) -> np.ndarray:
        if env is not self._env:
            self._env, self._teacher = env, Teacher(env)
        return self._teacher.act()


@dataclass(frozen=True)
class Contender:
    """A policy and the environment that it was made for."""

    name: str
    policy: Policy
    stage: str  # what it was trained for, or "vision"
    stride: int = EnvConfig.stride
    airframe: str = EnvConfig.airframe
    guidance: bool = False  # made to be flown with guidance outside
    guidance_changes: Mapping[str, float] = field(default_factory=dict)

    def config(self, stage: str | None, seed: int, **changes: object) -> EnvConfig:
        """The environment to evaluate it in; `stage` None: its own. Odometry is perfect in the state stage.

        `seed`: the environment's, see `evaluate.evaluation_seed`; `changes`: further settings of EnvConfig.
        """
        stage = stage or self.stage
        settings = {"odometry_noise": 0.0 if stage == "state" else 1.0, "noise_scale": (1.0, 1.0), **changes}
        made_for = {"stride": self.stride, "airframe": self.airframe}
        guided = {"guidance": self.guidance, "guidance_changes": self.guidance_changes}
        return EnvConfig(stage=stage, seed=seed, **{**made_for, **guided, **settings})  # type: ignore[arg-type]


def open_contender(name: str) -> Contender:
    """The contender called `name`, or that of an ONNX file's path.

    Names: `vision` and `state` (the networks that come with the project), `planner` (it predicts by a network),
    `planner-analytic`, `expert` (on privileged information), `fast-perching` (it predicts that the board drives
    straight on), `fast-perching-ctrv` (it predicts that the board keeps its turn rate).

    Raises ContractError for a file that cannot be flown, ValueError for a name that is neither.
    """
    if name.startswith("fast-perching") and name in NAMES:
        return Contender(name, FastPerching(turning=name.endswith("ctrv")), "state")
    if name == "expert":
        return Contender(name, Expert(), "vision")
    file = policy_file(name)
    if file is None and name in NAMES:
        planner = PlannerInEnv(LEARNED if name == "planner" else ANALYTIC)
        return Contender(name, planner, "vision", guidance=True, guidance_changes=GUIDANCE)
    if file is None or file.suffix != ".onnx":
        near = difflib.get_close_matches(name, NAMES, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise ValueError(f"no policy '{name}': give {', '.join(NAMES)} or the path of an .onnx file{hint}")
    made = OnnxPolicy(file)
    contract = made.network.contract
    made_for = contract.stage, contract.observation.stride, contract.airframe, contract.guidance
    return Contender(contract.name, made, *made_for)
