"""Runs: recipes checked, files left behind, killed and resumed to the same curve, one clear line for what is wrong."""

import subprocess
import sys

import pytest
import torch

from policies.flying.contract import read_contract
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
from tests.paths import ROOT

torch.set_num_threads(1)

TINY = """
title = "tiny"
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
    assert {"paper", "imitate", "reverse", "smoke"} <= set(list_recipes())
    for name in list_recipes():
        recipe = load_recipe(name)
        assert recipe.env_config("state", 1).stage == "state"
    paper = load_recipe("paper")
    phase = paper.phase[0]
    assert paper.phase_config(phase).samples == 40_000_000
    env = paper.env_config("state", 1, phase)
    assert (env.stride, env.speed, env.weights.row()[16]) == (1, (0.0, 2.5), 0.0)


def test_the_learned_baseline_narrows_its_goal_to_the_paper_s_and_is_paid_for_nothing_but_reaching_it():
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
        ("[env]", "network = { soft = -0.5 }\n[env]", "network: soft is -0.5"),
        ("[env]", "network = { lean = inf }\n[env]", "network: lean is inf"),
        ("[env]", "network = { channels = [24, 32] }\n[env]", "three sizes"),
        ("[env]", "network = { width = 0 }\n[env]", "width is 0"),
    ],
)
def test_bad_recipes_say_what_is_wrong(tiny, old, new, words):
    tiny.write_text(TINY.replace(old, new))
    with pytest.raises(RecipeError, match=words) as error:
        load_recipe(tiny)
    assert "\n" not in str(error.value)


def test_unknown_recipe_names_the_nearest():
    with pytest.raises(RecipeError, match="did you mean 'imitate'"):
        load_recipe("immitate")
    assert FOLDER.is_dir()


def test_run_resume_and_what_is_left_behind(tiny, tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    recipe = str(tiny)
    policy = run("state", recipe, 3, whole)
    steps = [0]

    def after_two() -> bool:
        steps[0] += 1
        return steps[0] == 2

    run("state", recipe, 3, broken, stop=after_two)
    assert len((broken / CURVE).read_text().splitlines()) == 3
    run("state", recipe, 3, broken, resume=True)
    assert (broken / CURVE).read_text() == (whole / CURVE).read_text()
    a, b = load_actor(whole / ACTOR)[0].state_dict(), load_actor(broken / ACTOR)[0].state_dict()
    assert all(torch.equal(a[k], b[k]) for k in a)
    assert policy == whole / POLICY
    contract = read_contract(policy)
    assert contract.stage == "state" and contract.provenance.samples == 1024 + 768
    assert contract.provenance.recipe == "tiny" and contract.observation.stride == 3
    assert (whole / PICTURE).read_text().startswith("<svg")
    with pytest.raises(TrainingError, match="another recipe, stage or seed"):
        run("state", recipe, 4, whole, resume=True)


def test_vision_run_from_a_state_actor(tiny, tmp_path):
    run("state", str(tiny), 1, tmp_path / "s")
    stopped = tmp_path / "v"
    run("vision", str(tiny), 1, stopped, parent=tmp_path / "s", stop=lambda: True)
    policy = run("vision", str(tiny), 1, stopped, resume=True)
    contract = read_contract(policy)
    assert contract.stage == "vision" and contract.provenance.parent == "tiny-state-1"
    assert contract.provenance.samples == 2 * (1024 + 768)
    other = tmp_path / "other.toml"
    other.write_text(TINY + "[network]\nwidth = 64\n")
    with pytest.raises(TrainingError, match="another network"):
        run("vision", str(other), 1, tmp_path / "w", parent=tmp_path / "s" / ACTOR)


def test_a_checkpoint_of_another_version_is_refused(tiny, tmp_path):
    path = tmp_path / "run" / CHECKPOINT
    run("state", str(tiny), 1, tmp_path / "run", stop=lambda: True)
    saved = load_checkpoint(path)
    save_checkpoint(path, {**saved, "version": (VERSION[0] + 1, *VERSION[1:])})
    with pytest.raises(TrainingError, match="version 2 perchrl-yaw 3, this is 1 perchrl-yaw 3"):
        run("state", str(tiny), 1, tmp_path / "run", resume=True)
    save_checkpoint(path, {**saved, "learner": {**saved["learner"], "replay": {}}})
    with pytest.raises(TrainingError, match="does not fit") as error:
        run("state", str(tiny), 1, tmp_path / "run", resume=True)
    assert "\n" not in str(error.value)
    with pytest.raises(TrainingError, match="not an actor"):
        load_actor(path)


def test_what_is_not_finite_is_named_and_the_last_good_checkpoint_kept(tiny, tmp_path):
    """A reward weight turns to NaN in the second phase; the first one's checkpoint stays and can be gone on from."""
    tiny.write_text(TINY.replace("impact = 100.0", "aggressiveness = nan"))
    with pytest.raises(DivergedError, match=r"reward term .*aggr.*last good checkpoint is kept") as error:
        run("state", str(tiny), 1, tmp_path / "run")
    assert "\n" not in str(error.value)
    saved = load_checkpoint(tmp_path / "run" / CHECKPOINT)
    assert saved["phase"] == 0 and saved["total"] == 1024
    assert all(torch.isfinite(value).all() for value in saved["learner"]["actor"].values())
    read_contract(tmp_path / "run" / POLICY)


def test_weights_that_are_not_finite_are_never_saved(tiny, tmp_path, monkeypatch):
    plain = Dagger.step

    def poisoned(self):
        numbers = plain(self)
        if self.samples >= 512:
            with torch.no_grad():
                self.actor.head.bias[1] = float("nan")
        return numbers

    monkeypatch.setattr(Dagger, "step", poisoned)
    with pytest.raises(DivergedError, match=r"weights actor.head.bias.*after 512 samples; there was no checkpoint yet"):
        run("state", str(tiny), 1, tmp_path / "run")
    assert not (tmp_path / "run" / CHECKPOINT).exists()


def test_what_is_wrong_is_one_line(tiny, tmp_path):
    with pytest.raises(TrainingError, match="does not exist"):
        run("state", str(tiny), 1, tmp_path / "none", resume=True)
    (tmp_path / CHECKPOINT).write_bytes(b"not a checkpoint")
    with pytest.raises(TrainingError, match="damaged"):
        load_checkpoint(tmp_path / CHECKPOINT)
    with pytest.raises(TrainingError, match="no device 'gpu'"):
        run("state", str(tiny), 1, tmp_path / "gpu", device="gpu")


@pytest.mark.parametrize(("device", "count"), [("cuda", 0), ("cuda:0", 0), ("cuda:2", 2)])
def test_a_gpu_that_is_not_there(tiny, tmp_path, monkeypatch, device, count):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: count)
    with pytest.raises(TrainingError, match=f"'{device}' was asked for.*(no CUDA GPU|2 CUDA GPUs) here"):
        run("state", str(tiny), 1, tmp_path / "gpu", device=device)


def test_curve_drops_what_came_after_the_checkpoint(tmp_path):
    path = tmp_path / "c.csv"
    curve = Curve(path, None)
    for k in range(5):
        curve.add({"samples": 100 * k, "success": 0.1 * k})
    again = Curve(path, 200)
    again.add({"samples": 300, "success": 0.9})
    lines = path.read_text().splitlines()
    assert lines[0] == "samples,success" and lines[-1] == "300,0.9" and len(lines) == 5


SEARCH = """[[phase]]
kind = "pgpe"
settings = { samples = 2000, pairs = 1, directions = 3 }
"""


def test_policy_search_is_a_phase_as_any_other(tiny, tmp_path):
    tiny.write_text(TINY + SEARCH)
    run("state", str(tiny), 1, tmp_path / "run")
    saved = load_checkpoint(tmp_path / "run" / CHECKPOINT)
    assert saved["phase"] == 2 and saved["total"] == 1024 + 768 + saved["learner"]["samples"]
    assert float((tmp_path / "run" / CURVE).read_text().splitlines()[-1].split(",")[1]) == 2.0


@pytest.mark.parametrize("kind", ["pgpe", "fit"])
def test_a_phase_that_takes_no_teacher_refuses_one(kind, tiny):
    tiny.write_text(f'{TINY}[[phase]]\nkind = "{kind}"\nteacher = {{ sink = 1.0 }}\n')
    with pytest.raises(RecipeError, match=f"'{kind}' has no teacher"):
        load_recipe(tiny)


def test_a_layer_that_the_network_lacks_cannot_be_fitted(tiny, tmp_path):
    tiny.write_text(TINY + '[[phase]]\nkind = "fit"\n')
    with pytest.raises(TrainingError, match="regimes, mirrored"):
        run("state", str(tiny), 1, tmp_path / "run")


@pytest.mark.slow
def test_two_processes_by_torchrun(tiny, tmp_path):
    """Two gloo processes learn one set of weights."""
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2", "--master-port=29617"]
    command += ["-m", "hil", "train", "--recipe", str(tiny), "--seed", "5", "--out", str(tmp_path / "two")]
    root = ROOT
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    states = [load_checkpoint(tmp_path / "two" / f"checkpoint-{k}.pt")["learner"] for k in range(2)]
    for name in states[0]["actor"]:
        assert torch.equal(states[0]["actor"][name], states[1]["actor"][name])
    assert not torch.equal(torch.from_numpy(states[0]["env"]["vehicle"]), torch.from_numpy(states[1]["env"]["vehicle"]))
