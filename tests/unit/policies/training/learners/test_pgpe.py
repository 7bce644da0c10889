"""Policy search: the score by hand, improvement, resume."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from policies.environment.config import EnvConfig
from policies.environment.rows import E_STEPS, ENDED_DIM
from policies.flying.shipped import policy_file
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.regimes import REGIMES
from policies.network.widen import widened
from policies.task import entry_row, result_row
from policies.task.contact import ContactRules
from policies.task.observation import OBS_DIM, TAIL
from policies.training.actor import load_actor
from policies.training.learners.pgpe import Pgpe, PgpeConfig, score

torch.set_num_threads(1)
ENV = EnvConfig(count=48, seed=31, odometry_noise=0.0, future_stride=10, speed=(1.0, 2.0), inclination_deg=(0.0, 50.0))
SMALL = PgpeConfig(samples=10_000_000, pairs=2, directions=6)


def shipped_actor() -> Actor:
    path = policy_file("state")
    assert path is not None
    return load_actor(path)[0]


def test_score_by_hand():
    rules, config = ContactRules(), PgpeConfig()
    ended = np.zeros((4, ENDED_DIM))
    ended[:3, result_row.TOUCHED], ended[:, E_STEPS] = 1.0, 200
    ended[0, [result_row.PLANAR, result_row.TANGENTIAL_SPEED, result_row.NORMAL_ERROR, result_row.NORMAL_SPEED]] = (
        0.0,
        0.0,
        0.0,
        -0.5,
    )
    ended[1, [result_row.PLANAR, result_row.TANGENTIAL_SPEED, result_row.NORMAL_ERROR, result_row.NORMAL_SPEED]] = (
        0.2,
        0.0,
        0.0,
        -0.5,
    )
    ended[2, [result_row.PLANAR, result_row.TANGENTIAL_SPEED, result_row.NORMAL_ERROR, result_row.NORMAL_SPEED]] = (
        0.0,
        0.6,
        0.0,
        -1.65,
    )
    full = 1.0 / (1.0 + np.exp(-1.0 / 0.12))  # nothing of a tolerance used
    got = score(ended, rules, config)
    late = 0.03 * 2.0
    assert got[0] == pytest.approx(full**3 * (1.0 - late))
    assert got[1] == pytest.approx(0.5 * full**2 * (1.0 - late))
    assert got[2] == pytest.approx(0.5 * full**2 * (1.0 - late - 0.2 * 1.0))
    assert got[3] == 0.0


@pytest.mark.slow
def test_search_mends_a_layer_that_was_put_out_of_order():
    actor = shipped_actor()
    with torch.no_grad():
        actor.head.bias[3] -= 0.3  # thrust: it falls onto the board
    config = replace(SMALL, near=1.0, pairs=6, rate=60.0, momentum=0.0, sigma=0.02)
    run = Pgpe(replace(ENV, count=64), actor.config, config, actor=actor)
    scores = [run.step()["score"] for _ in range(4)]
    assert scores[-1] > scores[0] + 0.2
    assert float(run.space.offset.detach()[3, -1]) > 0.0


def test_resume_gives_the_same_curve():
    def fresh() -> Pgpe:
        actor = shipped_actor()
        return Pgpe(replace(ENV, count=8), actor.config, replace(SMALL, near=1.0, turning=0.5), actor=actor)

    whole, half, rest = fresh(), fresh(), fresh()
    curve = [whole.step() for _ in range(3)]
    half.step()
    rest.load(half.state())
    assert [rest.step(), rest.step()] == curve[1:]
    for a, b in zip(whole.average.parameters(), rest.average.parameters(), strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize(
    ("name", "value"),
    [("pairs", 0), ("directions", 0), ("near", 0.0), ("turning", 0.1), ("sigma", -1.0), ("momentum", 1.0)],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        PgpeConfig(**{name: value})


def test_only_the_last_layer_moves():
    actor = Actor(NetworkConfig(width=32))
    before = {k: v.clone() for k, v in actor.state_dict().items()}
    run = Pgpe(replace(ENV, count=16), actor.config, SMALL, actor=actor)
    run._move(torch.ones_like(run.space.offset))
    run.space.span(torch.randn(50, 32))
    run._move(torch.ones_like(run.space.offset))
    changed = {k for k, v in run.actor.state_dict().items() if not torch.equal(v, before[k])}
    assert changed == {"head.weight", "head.bias"}


def test_over_flat_boards_the_other_regimes_stay():
    plain = shipped_actor()
    actor = widened(plain, replace(plain.config, regimes=True))
    config = replace(SMALL, near=1.0, pairs=1)
    run = Pgpe(replace(ENV, count=8, inclination_deg=(0.0, 0.0)), actor.config, config, actor=actor)
    run.step()
    moved = run.space.offset.detach().abs().sum(1)
    assert bool((moved[:4] > 0.0).all()) and bool((moved[4:] == 0.0).all())


def test_a_flight_tells_of_every_regime_that_it_flew_by():
    actor = Actor(NetworkConfig(width=32, regimes=True))
    run = Pgpe(replace(ENV, count=2), actor.config, SMALL, actor=actor)
    over = np.zeros((2, 1, OBS_DIM), dtype=np.float32)
    over[:, :, TAIL - entry_row.DIM + 5] = [[1.0], [0.0]]  # a flat board, then an upright one
    shares = torch.zeros(3, REGIMES)
    act = run._act(shares=shares)
    for seen in over:
        act(seen, np.array([1]))
    flat, upright = (actor.shares(torch.from_numpy(seen))[0] for seen in over)
    assert float((flat * upright).max()) == 0.0
    assert torch.equal(shares[1], torch.maximum(flat, upright))
    assert not shares[[0, 2]].any()
