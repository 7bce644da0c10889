"""Runs: recipes checked, files left behind, killed and resumed to the same curve, one clear line for what is wrong."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from policies.flying.onnx_file import open_policy
from policies.training.actor import ACTOR, POLICY, load_actor
from policies.training.learners.dagger import Dagger
from policies.training.learners.storage import (
    VERSION,
    Curve,
    DivergedError,
    TrainingError,
    load_checkpoint,
    save_checkpoint,
)
from policies.training.recipe import FOLDER, RecipeError, list_recipes, load_recipe
from policies.training.run import CHECKPOINT, CURVE, PICTURE, run

torch.set_num_threads(1)

TINY = """
title = "tiny"
[network]
channels = [24, 32, 48]
width = 128
[env]
count = 32
future_stride = 10
horizon = 160
odometry_noise = 0.0
[[phase]]
kind = "dagger"
settings = { samples = 1024, horizon = 8, replay = 1024, batch = 64, batches = 2, teacher_fade = 512 }
[[phase]]
kind = "ppo"
settings = { samples = 768, horizon = 8, minibatch = 64, epochs = 1 }
weights = { impact = 100.0 }
"""


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def test_all_recipes_load():
    assert set(list_recipes()) == {
        "state",
        "vision",
        "airframe",
        "wall",
        "paper",
        "incline-lander",
        "ablation",
        "smoke",
    }
    for name in list_recipes():
        recipe = load_recipe(name)
        assert recipe.env_config("state", 1).stage == "state"
    paper = load_recipe("paper")
    phase = paper.phase[0]
    assert paper.phase_config(phase).samples == 40_000_000
    env = paper.env_config("state", 1, phase)
    assert (env.stride, env.speed, env.weights.row()[16]) == (1, (0.0, 2.5), 0.0)


def test_learned_baseline_tightens_its_tolerances_to_the_paper_with_a_sparse_reward():
    recipe = load_recipe("incline-lander")
    envs = [recipe.env_config("state", 1, phase) for phase in recipe.phase]
    limits = [(env.rules.delta_d, env.rules.delta_v, env.rules.delta_theta) for env in envs]
    assert limits == sorted(limits, reverse=True)
    assert limits[-1] == (0.2, 0.6, 0.2)
    assert sum(recipe.phase_config(phase).samples for phase in recipe.phase) == 40_000_000
    paid = {name: value for name, value in vars(envs[0].weights).items() if name in ("guide", "action", "smoothness")}
    assert set(paid.values()) == {0.0}
    assert not recipe.network_config().temporal


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("weights = {", "rules = { delta_x = 0.3 }\nweights = {", "delta_x"),
        ('kind = "dagger"', 'kind = "sarsa"', "sarsa"),
        ("count = 32", "cuont = 32", "did you mean 'count'"),
        ("count = 32", 'count = "many"', "count"),
        ("samples = 1024", "samples = 10.5", "samples"),
        ("[env]", "[env", "not valid TOML"),
        ("impact = 100.0", "impcat = 100.0", "did you mean 'impact'"),
        ("count = 32", "count = 0", "at least 1"),
        (
            'title = "tiny"',
            'title = "tiny"\nlayout = "perchrl-yaw 2"',
            "observation layout perchrl-yaw 2, this version",
        ),
        ('title = "tiny"', 'title = "tiny"\nbudget = 0.0', "budget"),
        ("[24, 32, 48]", "[24, 32]", "three sizes"),
        ("width = 128", "width = 0", "width is 0"),
    ],
)
def test_error_of_an_invalid_recipe_names_the_fault(tiny, old, new, words):
    tiny.write_text(TINY.replace(old, new))
    with pytest.raises(RecipeError, match=words) as error:
        load_recipe(tiny)
    assert "\n" not in str(error.value)


def test_unknown_recipe_names_the_nearest():
    with pytest.raises(RecipeError, match="did you mean 'vision'"):
        load_recipe("vison")
    assert FOLDER.is_dir()


def test_resumed_training_equals_an_uninterrupted_one(tiny, tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    recipe = load_recipe(tiny)
    policy = run(recipe, "state", 3, whole)
    steps = [0]

    def after_two() -> bool:
        steps[0] += 1
        return steps[0] == 2

    run(recipe, "state", 3, broken, stop=after_two)
    assert len((broken / CURVE).read_text().splitlines()) == 3
    run(recipe, "state", 3, broken, resume=True)
    assert (broken / CURVE).read_text() == (whole / CURVE).read_text()
    a, b = load_actor(whole / ACTOR)[0].state_dict(), load_actor(broken / ACTOR)[0].state_dict()
    assert all(torch.equal(a[k], b[k]) for k in a)
    assert policy == whole / POLICY
    contract = open_policy(policy).contract
    assert contract.stage == "state" and contract.provenance.samples == 1024 + 768
    assert contract.provenance.recipe == "tiny" and contract.observation.stride == 3
    assert (whole / PICTURE).read_text().startswith("<svg")
    with pytest.raises(TrainingError, match="another recipe, airframe, stage or seed"):
        run(recipe, "state", 4, whole, resume=True)


def test_vision_training_starts_from_a_state_actor(tiny, tmp_path):
    run(load_recipe(tiny), "state", 1, tmp_path / "s")
    stopped = tmp_path / "v"
    run(load_recipe(tiny), "vision", 1, stopped, parent=tmp_path / "s", stop=lambda: True)
    policy = run(load_recipe(tiny), "vision", 1, stopped, resume=True)
    contract = open_policy(policy).contract
    assert contract.stage == "vision" and contract.provenance.parent == "tiny-state-paper_quad-1"
    assert contract.provenance.samples == 2 * (1024 + 768)
    other = tmp_path / "other.toml"
    other.write_text(TINY.replace("width = 128", "width = 64"))
    with pytest.raises(TrainingError, match="another network"):
        run(load_recipe(other), "vision", 1, tmp_path / "w", parent=tmp_path / "s" / ACTOR)


def test_a_checkpoint_of_another_version_is_refused(tiny, tmp_path):
    path = tmp_path / "run" / CHECKPOINT
    run(load_recipe(tiny), "state", 1, tmp_path / "run", stop=lambda: True)
    saved = load_checkpoint(path)
    save_checkpoint(path, {**saved, "version": (VERSION[0] + 1, *VERSION[1:])})
    with pytest.raises(TrainingError, match="version 4 perchrl-yaw 3, this is 3 perchrl-yaw 3"):
        run(load_recipe(tiny), "state", 1, tmp_path / "run", resume=True)
    save_checkpoint(path, {**saved, "learner": {**saved["learner"], "replay": {}}})
    with pytest.raises(TrainingError, match="does not fit") as error:
        run(load_recipe(tiny), "state", 1, tmp_path / "run", resume=True)
    assert "\n" not in str(error.value)
    with pytest.raises(TrainingError, match="not an actor"):
        load_actor(path)


def test_non_finite_value_is_named_and_the_last_finite_checkpoint_kept(tiny, tmp_path, monkeypatch):
    """A reward weight turns to NaN in the second phase; the first one's checkpoint stays and can be gone on from."""
    monkeypatch.setattr("policies.training.recipe._fits", lambda old, value: True)  # no recipe may say NaN
    tiny.write_text(TINY.replace("impact = 100.0", "aggressiveness = nan"))
    with pytest.raises(DivergedError, match=r"reward term .*aggr.*last good checkpoint is kept") as error:
        run(load_recipe(tiny), "state", 1, tmp_path / "run")
    assert "\n" not in str(error.value)
    saved = load_checkpoint(tmp_path / "run" / CHECKPOINT)
    assert saved["phase"] == 0 and saved["total"] == 1024
    assert all(torch.isfinite(value).all() for value in saved["learner"]["actor"].values())
    open_policy(tmp_path / "run" / POLICY)


def test_non_finite_weights_are_never_saved(tiny, tmp_path, monkeypatch):
    plain = Dagger.step

    def poisoned(self):
        numbers = plain(self)
        if self.samples >= 512:
            with torch.no_grad():
                self.actor.head.bias[1] = float("nan")
        return numbers

    monkeypatch.setattr(Dagger, "step", poisoned)
    with pytest.raises(DivergedError, match=r"weights actor.head.bias.*after 512 samples; there was no checkpoint yet"):
        run(load_recipe(tiny), "state", 1, tmp_path / "run")
    assert not (tmp_path / "run" / CHECKPOINT).exists()


def test_missing_or_damaged_checkpoint_and_unknown_device_raise_training_errors(tiny, tmp_path):
    with pytest.raises(TrainingError, match="does not exist"):
        run(load_recipe(tiny), "state", 1, tmp_path / "none", resume=True)
    (tmp_path / CHECKPOINT).write_bytes(b"not a checkpoint")
    with pytest.raises(TrainingError, match="damaged"):
        load_checkpoint(tmp_path / CHECKPOINT)
    with pytest.raises(TrainingError, match="no device 'gpu'"):
        run(load_recipe(tiny), "state", 1, tmp_path / "gpu", device="gpu")


class Code:
    """Runs code when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_checkpoint_that_holds_code_is_refused_and_the_code_not_run(tmp_path):
    torch.save({"version": VERSION, "learner": Code(tmp_path / "ran")}, tmp_path / CHECKPOINT)
    with pytest.raises(TrainingError, match="is damaged or of an older version") as error:
        load_checkpoint(tmp_path / CHECKPOINT)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "ran").exists()


def test_checkpoint_of_another_user_is_refused(tmp_path, monkeypatch):
    save_checkpoint(tmp_path / CHECKPOINT, {"steps": np.array(3)})
    assert load_checkpoint(tmp_path / CHECKPOINT)["steps"] == 3
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(TrainingError, match=f"belongs to another user .uid {os.getuid()}.; copy it"):
        load_checkpoint(tmp_path / CHECKPOINT)


def test_curve_drops_rows_after_the_checkpoint(tmp_path):
    path = tmp_path / "c.csv"
    curve = Curve(path, None)
    for k in range(5):
        curve.add({"samples": 100 * k, "success": 0.1 * k})
    again = Curve(path, 200)
    again.add({"samples": 300, "success": 0.9})
    lines = path.read_text().splitlines()
    assert lines[0] == "samples,success" and lines[-1] == "300,0.9" and len(lines) == 5


def test_changes_of_a_recipe_are_checked_as_the_file_is(tiny):
    recipe = load_recipe(tiny).changed(["network.width=64", "env.rho=false", "budget=0.5", "env.airframe=sih_quad"])
    assert recipe.network_config().width == 64
    env = recipe.env_config("vision", 1)
    assert (env.rho, env.airframe, env.count) == (False, "sih_quad", 32)
    assert [recipe.phase_config(phase).samples for phase in recipe.phase] == [512, 384]
    for change, words in (
        ("network.widht=64", "did you mean 'width'"),
        ("width=64", "SECTION.KEY"),
        ("env.rho", "give"),
    ):
        with pytest.raises(RecipeError, match=words):
            recipe.changed([change])


def test_missing_airframe_raises_a_one_line_error(tiny, tmp_path):
    recipe = load_recipe(tiny).changed(["env.airframe=papr_quad"])
    with pytest.raises(TrainingError, match="did you mean 'paper_quad'"):
        run(recipe, "state", 1, tmp_path / "run")


def test_out_of_memory_error_names_the_settings_to_lower(tiny, tmp_path, monkeypatch):
    def full(self):
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB")

    monkeypatch.setattr(Dagger, "step", full)
    with pytest.raises(TrainingError, match="lower its setting replay or batch") as error:
        run(load_recipe(tiny), "state", 1, tmp_path / "run")
    assert "\n" not in str(error.value)
