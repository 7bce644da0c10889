"""Training works: the smoke recipe, from weights that never perch to weights that perch."""

from dataclasses import replace

import pytest

from policies.evaluation.contenders import OnnxPolicy
from policies.evaluation.evaluate import evaluation_seed, run_episodes, summarise
from policies.flying.contract import Provenance
from policies.network.actor_critic import Actor
from policies.network.export import export
from policies.training.actor import contract_for
from policies.training.recipe import load_recipe
from policies.training.run import run


@pytest.mark.slow
def test_smoke_training_raises_success(tmp_path):
    recipe = load_recipe("smoke")
    env = replace(recipe.env_config("state", 1), count=100, seed=evaluation_seed(1))

    def success(path) -> float:
        return summarise("", run_episodes(OnnxPolicy(path), env)).success

    start = tmp_path / "start.onnx"
    nothing = Provenance(recipe="none", seed=0, samples=0)
    export(Actor(recipe.network_config()), contract_for(env, "start", nothing), start)
    before = success(start)
    after = success(run(recipe, "state", 1, tmp_path / "run"))
    assert before <= 5.0
    assert after >= 70.0
