"""Guidance as a whole: conditions, authority, order, numbers that are not finite."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.flying.guided import GuidedPolicy
from policies.flying.registry import policy_factory
from policies.guidance import params as gp
from policies.guidance.guide import ALIGNED, BRAKED, FLARED, NOT_FINITE, guide
from policies.guidance.params import GuidanceParams
from policies.planner.policy import GUIDANCE
from tests.unit.policies.guidance.situation import situation
from vehicle.quadrotor.airframe import list_airframes, load_airframe

FRAMES = [GuidanceParams.of(load_airframe(name)) for name in list_airframes()]
PAPER = GuidanceParams.of(load_airframe("paper_quad"))
STILL = np.array([0.0, 0.0, 0.0, 9.8])


def guided(here, asked, params=PAPER, sigma=0.001, previous=STILL, gain=1.0, drag=0.2):
    board, p, v, q = here
    command = np.array(asked, dtype=np.float64)
    return guide(command, p, v, q, board, sigma, np.array(previous), gain, drag, params.row()), command


unit = st.floats(-1.0, 1.0)
somewhere = st.builds(
    situation, st.floats(0.0, 1.5), st.floats(-1.0, 1.6), st.floats(-1.0, 1.0), st.floats(-0.1, 0.8),
    closing=st.floats(-1.0, 5.0), speed=st.floats(0.0, 3.2), turn=st.floats(-1.8, 1.8), heading=st.floats(-3.1, 3.1),
    beside=st.floats(-0.8, 0.8),
)  # fmt: skip


@given(
    somewhere, st.lists(unit, min_size=8, max_size=8), st.sampled_from(FRAMES), st.floats(0.0, 0.02),
    st.floats(0.5, 1.5), st.floats(0.0, 1.0),
)  # fmt: skip
def test_guidance_is_bounded_by_the_airframe_and_flags_its_changes(here, actions, params, sigma, gain, drag):
    half = 0.5 * (params.thrust_max - params.thrust_min)
    scale, shift = np.array([*[params.rate_max] * 3, half]), np.array([0.0, 0.0, 0.0, params.thrust_min + half])
    asked, previous = (scale * np.array(part) + shift for part in (actions[:4], actions[4:]))
    laws, command = guided(here, asked, params, sigma, previous, gain, drag)
    assert np.isfinite(command).all()
    assert np.abs(command[:3]).max() <= params.rate_max
    assert params.thrust_min <= command[3] <= params.thrust_max + 1e-12
    assert command[2] == asked[2] and command[3] >= asked[3]
    assert (command[:2] == asked[:2]).all() or laws & (ALIGNED | FLARED)
    assert (command[3] != asked[3]) == bool(laws & BRAKED)
    assert not laws & NOT_FINITE
    _conditions(here, laws, params, sigma, gain)


def _conditions(here, laws, params, sigma, gain):
    """Each law that acted had its condition of the table in `guide.py`."""
    board, p, v, q = here
    n, d = np.array(board_normal(board)), p - board[:3]
    ahead = board[4] * np.array([math.cos(board[3]), math.sin(board[3]), 0.0])
    closing, cosine = -n @ (v - ahead), n @ np.array(body_z(q))
    offset = math.sqrt(max(0.0, d @ d - (n @ d) ** 2))
    if laws & ALIGNED:
        assert closing >= params.align_closing and cosine >= params.align_cosine
        assert offset <= params.align_offset + 1e-6
        edge = params.below * cosine + params.radius * math.sqrt(max(0.0, 1.0 - cosine**2))
        assert n @ d - edge <= params.align_within * closing + params.align_earliest + 1e-9
    if laws & FLARED:
        assert closing >= params.flare_closing and cosine >= 0.0 and offset <= params.flare_offset + 1e-6
        assert 0.0 < n @ d - params.below <= closing * params.flare_within + 0.2 * params.radius
    if laws & BRAKED:
        assert closing > params.impact_speed and cosine >= params.impact_cosine
        assert offset <= params.impact_offset + 1e-6 and sigma < params.sigma_high
        height = n @ d - params.below - params.impact_tilt * params.radius
        assert 0.0 < height <= params.impact_within * closing + 1e-9


@pytest.mark.parametrize("what", ["command", "p", "v", "q", "board", "previous", "sigma", "gain", "drag"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_guidance_input_leaves_the_command_and_is_flagged(what, value):
    board, p, v, q = situation(1.0, -0.3, 0.0, 0.08)
    inputs = {
        "p": p,
        "v": v,
        "q": q,
        "board": board,
        "previous": STILL.copy(),
        "command": np.array([0.1, 0.2, 0.3, 6.0]),
    }
    numbers = {"sigma": 0.001, "gain": 1.0, "drag": 0.2}
    if what in numbers:
        numbers[what] = value
    else:
        inputs[what][1] = value
    asked = inputs["command"].copy()
    laws = guide(
        inputs["command"], inputs["p"], inputs["v"], inputs["q"], inputs["board"], numbers["sigma"], inputs["previous"],
        numbers["gain"], numbers["drag"], PAPER.row(),
    )  # fmt: skip
    assert laws == NOT_FINITE
    np.testing.assert_array_equal(inputs["command"], asked)


@pytest.mark.parametrize("size", [1e160, 1e300])
def test_non_finite_guidance_result_leaves_the_command(size):
    board, p, v, q = situation(1.0, -0.3, 0.0, 0.08)
    for inputs in (p, v):
        laws, command = guided((board, p + (inputs is p) * size, v - (inputs is v) * size, q), [0.1, 0.2, 0.3, 6.0])
        assert np.isfinite(command).all()
        assert laws in (0, ALIGNED, FLARED, ALIGNED | FLARED, BRAKED, NOT_FINITE)


def test_flare_replaces_alignment_and_braking_is_added():
    late = situation(math.radians(70.0), 1.0, 0.0, 0.05, closing=3.0)
    laws, command = guided(late, [0.0, 0.0, 0.0, 9.0])
    assert laws == ALIGNED | FLARED
    alone, without = guided(late, [0.0, 0.0, 0.0, 9.0], replace(PAPER, align_within=0.0))
    assert alone == FLARED and without.tolist() == command.tolist()
    near = situation(0.0, 0.2, 0.0, 0.06, closing=0.9)
    assert guided(near, [0.0, 0.0, 0.0, 5.0])[0] == ALIGNED | BRAKED


def test_larger_contact_disc_starts_guidance_earlier():
    small, large = (replace(PAPER, below=below) for below in (0.04, 0.10))
    here = situation(0.8, 0.4, 0.0, 0.2, closing=0.6)
    assert guided(here, STILL, small)[0] == 0
    assert guided(here, STILL, large)[0] & ALIGNED


def test_columns_of_the_row_are_the_guidance_parameters_in_order():
    names = list(PAPER.__dataclass_fields__)
    assert sorted(getattr(gp, name.upper()) for name in names) == list(range(gp.COUNT))
    row = PAPER.row()
    assert all(row[getattr(gp, name.upper())] == getattr(PAPER, name) for name in names)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lean": math.nan}, "lean is nan"), ({"below": -0.1}, "below"), ({"thrust_min": 15.0}, "thrust_min"),
        ({"align_shortest": 0.0}, "align_shortest is 0.0; it must be positive"), ({"sigma_low": 0.006}, "sigma_low"),
    ],
)  # fmt: skip
def test_wrong_parameter_is_named(change, message):
    with pytest.raises(ValueError, match="guidance parameter") as error:
        replace(PAPER, **change)
    assert message in str(error.value)


def test_guidance_of_a_flight_by_motion_capture_is_the_same_in_flight_and_training():
    airframe = load_airframe("crazyflie")
    env = Env(EnvConfig(stage="state", count=1, airframe="crazyflie"))
    wanted = GuidanceParams.of(airframe, by_state=True)
    assert (wanted.lean, wanted.lean_uncertain) == (0.04, 0.0)
    assert np.array_equal(env.shared.guidance, wanted.row())
    flying = policy_factory("planner-analytic", airframe, stage="state")()
    assert isinstance(flying, GuidedPolicy)
    assert np.array_equal(flying._row, replace(wanted, **GUIDANCE).row())
