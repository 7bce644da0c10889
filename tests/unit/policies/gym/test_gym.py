"""The Gymnasium environments: the checker's rules, the same episodes as the compiled environment, seeds, pictures."""

import json
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.gym import ID
from policies.gym.spaces import ACTION_NAMES, OBSERVATION_NAMES
from policies.task import entry_row, tail_row
from policies.task.observation import NEWEST, OBS_DIM, TAIL

NAME = f"policies.gym:{ID}"
SHORT = {"limit": 12, "horizon": 20}  # control steps: an episode's end comes soon


def actions(count, steps, seed=0):
    return np.random.default_rng(seed).uniform(-0.2, 0.2, (steps, count, 4)).astype(np.float32)


@pytest.mark.parametrize("stage", ["state", "vision"])
def test_environment_passes_the_checker(stage):
    env = gymnasium.make(NAME, stage=stage, render_mode="rgb_array")
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    told = [str(w.message) for w in found if "infinity" not in str(w.message)]  # the space is unbounded on purpose
    assert not told


def test_vector_environment_flies_the_episodes_of_the_compiled_one():
    settings = {"stage": "vision", "airframe": "sih_quad", **SHORT}
    ours, bare = gymnasium.make_vec(NAME, num_envs=6, **settings), Env(EnvConfig(count=6, seed=5, **settings))
    seen, _ = ours.reset(seed=5)
    assert np.array_equal(seen, bare.reset())
    for action in actions(6, 30):
        seen, reward, over, cut, infos = ours.step(action)
        assert np.array_equal(seen, bare.step(action)) and seen in ours.observation_space
        assert np.array_equal(reward, bare.rows.reward) and np.array_equal(over, bare.rows.done.astype(bool))
        assert not cut.any() and bool(infos) == over.any()


def test_single_environment_flies_row_0_of_the_vector_environment():
    one, many = gymnasium.make(NAME, **SHORT), gymnasium.make_vec(NAME, num_envs=3, **SHORT)
    single, _ = one.reset(seed=7)
    rows, _ = many.reset(seed=7)
    assert np.array_equal(single, rows[0])
    for action in actions(3, 12):
        before = rows
        single, reward, over, _, info = one.step(action[0])
        rows, rewards, ends, _, infos = many.step(action)
        assert reward == rewards[0] and over == ends[0]
        assert np.array_equal(single, before[0] if over else rows[0])
    assert over and info["cause"] == "time" and info["steps"] == 12 and not info["is_success"]
    assert infos["final_info"]["cause"][0] == "time" and infos["_final_info"][0] and infos["_final_obs"][0]
    assert np.array_equal(infos["final_obs"][0], single)


def test_observations_that_were_returned_do_not_change():
    env = gymnasium.make_vec(NAME, num_envs=4, **SHORT)
    kept = [env.reset(seed=1)[0]] + [env.step(action)[0] for action in actions(4, 15)]
    copies = [env.reset(seed=1)[0].copy()] + [env.step(action)[0].copy() for action in actions(4, 15)]
    assert all(np.array_equal(a, b) for a, b in zip(kept, copies, strict=True))
    assert len({a.ctypes.data for a in kept}) == len(kept)


def test_episodes_without_a_seed_go_on_and_differ():
    env = gymnasium.make(NAME, **SHORT)
    first, second = env.reset(seed=3)[0], env.reset()[0]
    assert not np.array_equal(first, second)
    assert np.array_equal(env.reset(seed=3)[0], first) and np.array_equal(env.reset()[0], second)
    other = gymnasium.make(NAME, **SHORT)
    assert not np.array_equal(other.reset()[0], gymnasium.make(NAME, **SHORT).reset()[0])


def test_success_is_told_with_its_measures():
    env = gymnasium.make_vec(NAME, num_envs=64, **SHORT)
    env.reset(seed=2)
    found = {}
    for action in actions(64, 12):
        *_, infos = env.step(action)
        found = infos.get("final_info", found)
    assert set(found) == {n for name in MEASURED for n in (name, f"_{name}")}
    assert found["_cause"].all() and found["steps"].max() == 12


MEASURED = (
    *("is_success", "attached", "cause", "steps"),
    *("planar", "normal_error", "normal_speed", "tangential_speed"),
)


def test_pictures_show_the_board_and_change_as_the_vehicle_moves():
    env = gymnasium.make(NAME, render_mode="rgb_array", stage="vision")
    env.reset(seed=4)
    first = env.render()
    for action in actions(1, 8):
        env.step(action[0])
    second = env.render()
    assert first.shape == second.shape == (720, 1280, 3) and first.dtype == np.uint8
    assert first.max() > 180 and not np.array_equal(first, second)
    assert gymnasium.make(NAME).unwrapped.render() is None


def test_every_vehicle_of_a_vector_environment_has_its_picture():
    env = gymnasium.make_vec(NAME, num_envs=2, render_mode="rgb_array")
    env.reset(seed=4)
    one, two = env.render()
    assert one.shape == (720, 1280, 3) and not np.array_equal(one, two)


def test_names_of_the_spaces_are_those_of_the_layout():
    assert len(OBSERVATION_NAMES) == len(set(OBSERVATION_NAMES)) == OBS_DIM and len(ACTION_NAMES) == 4
    assert OBSERVATION_NAMES[TAIL + tail_row.RHO] == "rho" and OBSERVATION_NAMES[TAIL + tail_row.GAIN] == "thrust_gain"
    assert OBSERVATION_NAMES[TAIL + tail_row.ACTION + 3] == "previous_thrust"
    assert OBSERVATION_NAMES[TAIL + tail_row.R + 5] == "rotation_12"
    assert OBSERVATION_NAMES[NEWEST + entry_row.NORMAL] == "board_29_normal_x"
    assert OBSERVATION_NAMES[entry_row.TIME] == "board_0_time"


def test_settings_survive_a_spec_as_json():
    env = gymnasium.make(NAME, speed=(0.5, 1.0), **SHORT)
    spec = EnvSpec.from_json(env.spec.to_json())
    assert isinstance(json.loads(env.spec.to_json())["kwargs"]["speed"], list)
    assert np.array_equal(gymnasium.make(spec).reset(seed=1)[0], env.reset(seed=1)[0])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"stage": "sound"}, "stage is 'sound'"),
        ({"airframe": "brick"}, "brick"),
        ({"sped": (0, 1)}, 'no setting "sped".*speed'),
        ({"seed": 3}, "seed is given otherwise"),
        ({"speed": (2.0, 1.0)}, "speed"),
    ],
)
def test_wrong_setting_is_refused_by_name(wrong, said):
    with pytest.raises(ValueError, match=said):
        gymnasium.make(NAME, **wrong)


def test_wrong_actions_are_refused():
    env = gymnasium.make_vec(NAME, num_envs=2, **SHORT)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.reset(seed=1)
    with pytest.raises(ValueError, match=r"shape \(3, 4\)"):
        env.step(np.zeros((3, 4), np.float32))
    with pytest.raises(ValueError, match="not finite"):
        env.step(np.full((2, 4), np.nan, np.float32))


def test_ppo_of_stable_baselines_learns_on_it_unchanged():
    sb3 = pytest.importorskip("stable_baselines3")
    env = gymnasium.make(NAME, **SHORT)
    model = sb3.PPO("MlpPolicy", env, n_steps=64, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(128)
    assert any(not (a == b).all() for a, b in zip(before, model.policy.parameters(), strict=True))
    assert model.ep_info_buffer[0]["l"] == 12
