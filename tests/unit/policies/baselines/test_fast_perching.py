"""Plans: the published launch case, limits, and what a plan ends in."""

import numpy as np
import pytest

from policies.baselines.fast_perching import load_search, plan_perch
from policies.baselines.fast_perching_params import FastPerchingParams
from policies.evaluation.contenders import open_contender

BODY = {"contact_below": 0.02, "contact_radius": 0.13}
LAUNCH = FastPerchingParams(thrust_min=5.0, thrust_max=17.0, gravity=9.8, **BODY)
OURS = FastPerchingParams(thrust_min=4.8, thrust_max=14.8, **BODY)
UPRIGHT = np.array([0.5, 0.0, 2.0, 0.0, 2.0, 0.0, np.pi / 2, 0.0])


def rest(x, y, z):
    start = np.zeros((4, 3))
    start[0] = x, y, z
    return start


def along(plan, gravity):
    states = np.array([plan.at(t) for t in np.linspace(0.0, plan.duration, 400)])
    force = states[:, 2] + (0.0, 0.0, gravity)
    thrust = np.linalg.norm(force, axis=1)
    up = force / thrust[:, None]
    across = states[:, 3] - up * (up * states[:, 3]).sum(1, keepdims=True)
    return states, thrust, np.linalg.norm(across, axis=1) / thrust


def test_published_launch_case_gives_the_published_figures():
    # The original's figures: T 2.972 s, thrust 7.25-16.85, omega 3.000, v 6.11, tail v (2.3, 0, -0.02). The search is
    # stopped long before the optimum, by the same rule but on another line search's path, and the path hangs on last
    # bits, which differ between processors: a start a micrometre away ends at 14.3 to 16.9 of thrust. Hence per cent of
    # the median of such starts.
    rng, shown = np.random.default_rng(0), []
    for _ in range(15):
        start = rest(*(np.array([0.0, 0.0, 2.0]) + rng.normal(0.0, 1e-6, 3)))
        plan = plan_perch(start, UPRIGHT, LAUNCH)
        states, thrust, rate = along(plan, 9.8)
        fastest = np.linalg.norm(states[:, 1], axis=1).max()
        shown.append((plan.duration, thrust.min(), thrust.max(), fastest, *states[-1, 1]))
        assert rate.max() == pytest.approx(3.0, rel=0.01)
        assert states[-1, 0] == pytest.approx((0.5 + 2.0 * plan.duration - 0.02, 0.0, 2.0), abs=1e-6)
    duration, least, most, fastest, *tail = np.median(shown, axis=0)
    assert duration == pytest.approx(2.972, rel=0.05)
    assert least == pytest.approx(7.246, rel=0.03)
    assert most == pytest.approx(16.845, rel=0.04)
    assert fastest == pytest.approx(6.112, rel=0.08)
    assert tail == pytest.approx((2.3, 0.0, -0.0219), abs=0.03)


def test_plan_begins_at_the_start_and_ends_on_the_board_in_its_attitude():
    board = np.array([1.0, 0.5, 1.5, 0.3, 1.5, 0.4, np.radians(40.0), 0.0])
    start = rest(-1.0, 0.0, 2.5)
    start[1] = 0.5, 0.1, 0.0
    plan = plan_perch(start, board, OURS)
    assert np.allclose(plan.at(0.0)[:2], start[:2], atol=1e-6)
    end, h = plan.at(plan.duration), 0.3 + 0.4 * plan.duration
    normal = np.array([-np.sin(board[6]) * np.cos(h), -np.sin(board[6]) * np.sin(h), np.cos(board[6])])
    force = end[2] + (0.0, 0.0, 9.80665)
    assert force / np.linalg.norm(force) == pytest.approx(normal, abs=1e-6)
    assert np.allclose(plan.at(plan.duration + 0.1)[0], end[0] + 0.1 * end[1])
    assert (end[1] - 1.5 * np.array([np.cos(h), np.sin(h), 0.0])) @ normal == pytest.approx(-0.3, abs=1e-6)


def test_replanning_from_the_last_plan_gives_the_same_contact():
    board = np.array([1.0, 0.0, 1.5, 0.0, 1.0, 0.0, np.radians(30.0), 0.0])
    first = plan_perch(rest(-1.0, 0.2, 2.5), board, OURS)
    board[0] += 0.1
    second = plan_perch(first.at(0.1), board, OURS, (first, 0.1))
    assert second.duration == pytest.approx(first.duration - 0.1, abs=0.15)
    assert np.allclose(second.at(0.0), first.at(0.1), atol=1e-6)


def test_missing_scipy_error_names_the_package_to_install(monkeypatch):
    load_search.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "scipy.optimize", None)
    with pytest.raises(ValueError, match="pip install"):
        open_contender("fast-perching")
