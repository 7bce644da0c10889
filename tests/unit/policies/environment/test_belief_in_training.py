"""The filter in the training environment (all motions, noise, delays, looking away): errors agree with covariance."""

import numpy as np
import pytest

from policies.environment import episode_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.estimation import belief_row, belief_state
from policies.estimation.board_ekf import belief_covariance
from policies.teachers.teacher import Teacher


def consistency(scale):
    """(NIS of the accepted, [(age of the newest exposure s, NEES of position, NEES of speed and turn rate)])."""
    env = Env(EnvConfig(stage="vision", count=128, seed=9, noise_scale=(scale, scale), warm=1.0))
    env.reset()
    teacher, x, p = Teacher(env), np.zeros(8), np.zeros(belief_state.DIM * belief_state.DIM)
    belief = env.rows.belief
    nis, found = [], []
    for k in range(120):
        before = belief[:, belief_row.ACCEPTED].copy()
        env.step(teacher.act())
        fresh = (belief[:, belief_row.ACCEPTED] == before + 1) & (belief[:, belief_row.STREAK] > 8)
        nis.extend(belief[fresh, belief_row.NIS])
        for i in range(k % 4, 128, 4):
            step = int(env.rows.state[i, episode_row.STEP])
            if belief[i, belief_row.STREAK] > 8:
                belief_covariance(belief[i], step * TICK, env.shared.belief, x, p)
                error, cov = x - env.rows.track[i, step], p.reshape(belief_state.DIM, belief_state.DIM)
                place, speed = (error[k] @ np.linalg.solve(cov[k, k], error[k]) for k in (slice(0, 2), slice(4, 6)))
                found.append((step * TICK - belief[i, belief_row.TIME], place, speed))
    return np.array(nis), np.array(found)


@pytest.mark.parametrize("scale", [0.3, 1.0])
def test_filter_errors_and_innovations_agree_with_their_covariances(scale):
    nis, found = consistency(scale)
    seen, lost = found[found[:, 0] < 0.1], found[found[:, 0] > 0.4]
    assert len(seen) > 500 and len(lost) > 100
    assert 2.0 < nis.mean() < 6.0  # five degrees of freedom
    for part in (seen, lost):  # two degrees of freedom each; the noise's constant bias is in the error too
        assert 0.2 < part[:, 1].mean() < 4.0
        assert 0.2 < part[:, 2].mean() < 3.0
