"""What a policy answers to broken odometry, a broken belief and a broken network: no command, and it keeps nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hil.contract.messages import Belief, VehicleState
from policies.flying.guided import GuidedPolicy
from policies.flying.onnx_file import open_policy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.registry import policy_factory
from policies.flying.shipped import FLYABLE, policy_file
from policies.guidance.guide import NOT_FINITE
from policies.task.interface import Command
from tests.unit.policies.flying.made_networks import made_for
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
AIRFRAME = load_airframe("paper_quad")


def odometry(now_ms, **changes):
    return replace(
        VehicleState(now_ms * MS, (0.0, 0.0, 2.5), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3), **changes
    )


def belief(now_ms, **changes):
    board = Belief(
        now_ms * MS, True, (2.0 + 1e-3 * now_ms, 0.1, 1.5), 0.0, 1.0, 0.0, 0.9, 1.0, (now_ms - 40) * MS, 50, 0,
        (1e-4,) * 9, 0.0, 50, 1e-3,
    )  # fmt: skip
    return replace(board, **changes)


def engaged(name):
    """The policy in flight for 100 ms."""
    policy = policy_factory(name, made_for(name))()
    policy.reset(0)
    for k in range(10):
        command = policy.step(10 * k * MS, odometry(10 * k), belief(10 * k))
    assert command.engaged
    return policy


def is_no_command(command):
    return command.engaged and all(map(math.isnan, (*command.body_rate, command.thrust)))


BROKEN_ODOMETRY = [
    {"position": (math.nan, 0.0, 2.0)}, {"velocity": (0.0, math.inf, 0.0)}, {"orientation": (math.nan, 0.0, 0.0, 0.0)},
    {"orientation": (0.0,) * 4}, {"body_rate": (0.0, 0.0, math.nan)}, {"position": (0.0, 1e300, 0.0)},
    {"stamp_ns": 3_600_000 * MS}, {"stamp_ns": -(2**63)},
]  # fmt: skip
BROKEN_BELIEF = [
    {"position": (0.0, 0.0, math.nan)}, {"heading": math.nan}, {"speed": math.inf}, {"turn_rate": math.nan},
    {"inclination": math.nan}, {"acceleration": math.nan}, {"rho": math.nan}, {"surface_sigma": math.nan},
    {"variance": (math.nan,) * 9}, {"speed": -1e300}, {"stamp_ns": 3_600_000 * MS}, {"stamp_ns": 0},
    {"last_exposure_ns": 3_600_000 * MS},
]  # fmt: skip


@pytest.mark.parametrize("name", FLYABLE)
def test_broken_odometry_or_belief_gives_no_command_and_is_not_kept(name):
    policy, twin = engaged(name), engaged(name)
    for changes in BROKEN_ODOMETRY:
        assert is_no_command(policy.step(600 * MS, odometry(600, **changes), belief(600))), changes
    for changes in BROKEN_BELIEF:
        assert is_no_command(policy.step(600 * MS, odometry(600), belief(600, **changes))), changes
    assert policy.step(610 * MS, odometry(610), belief(610)) == twin.step(610 * MS, odometry(610), belief(610))


@pytest.mark.parametrize("name", FLYABLE)
def test_broken_belief_engages_no_policy(name):
    policy = policy_factory(name, made_for(name))()
    policy.reset(0)
    assert not policy.step(0, odometry(0), belief(0, heading=math.nan)).engaged


class _Network:
    """A network whose next answers are given; then the real one's."""

    def __init__(self, real, answers):
        self._real, self._answers = real, answers

    def run(self, observations):
        return [self._answers.pop(0)] if self._answers else self._real.run(observations)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("output", range(4))
@pytest.mark.parametrize("guided", [True, False])
def test_number_out_of_the_network_that_is_not_finite_reaches_the_gate_and_not_the_next_observation(
    bad, output, guided
):
    network = OnnxPolicy(open_policy(policy_file("state")), AIRFRAME)
    policy = GuidedPolicy(network, AIRFRAME) if guided else network
    for k in range(3):
        policy.step(10 * k * MS, odometry(10 * k), belief(10 * k))
    before = network._action.copy()
    answer = np.zeros(4, dtype=np.float32)
    answer[output] = bad
    network._network = _Network(network._network, [answer])
    command = policy.step(30 * MS, odometry(30), belief(30))
    assert is_no_command(command)
    assert not guided or command.laws == NOT_FINITE
    assert (network._action == before).all()
    later = policy.step(40 * MS, odometry(40), belief(40))
    assert np.isfinite([*later.body_rate, later.thrust]).all()


def test_no_command_is_given_on_a_history_that_cannot_be_kept(monkeypatch):
    policy = OnnxPolicy(open_policy(policy_file("state")), AIRFRAME)
    policy.step(0, odometry(0), belief(0))
    monkeypatch.setattr(policy._builder, "push", lambda *_: False)
    assert is_no_command(policy.step(10 * MS, odometry(10), belief(10)))


@pytest.mark.parametrize("name", FLYABLE)
def test_command_flown_that_is_not_finite_is_ignored(name):
    policy, twin = engaged(name), engaged(name)
    policy.flown((math.nan, 0.0, 0.0), 9.8)
    policy.flown((0.0, 0.0, 0.0), math.inf)
    assert policy.step(100 * MS, odometry(100), belief(100)) == twin.step(100 * MS, odometry(100), belief(100))


def test_guidance_forgets_a_command_that_is_not_finite():
    class Asks:
        def __init__(self):
            self.thrust = 9.8

        def reset(self, now_ns):
            pass

        def step(self, now_ns, vehicle, board):
            return Command(True, (0.0, 0.0, 0.0), self.thrust, "", 1.0)

        def flown(self, body_rate, thrust):
            pass

    policy = GuidedPolicy(Asks(), AIRFRAME)
    policy._policy.thrust = math.nan
    assert math.isnan(policy.step(0, odometry(0), belief(0)).thrust)
    policy._policy.thrust = 9.8
    assert np.isfinite(policy._flown).all()
    assert policy.step(10 * MS, odometry(10), belief(10)).laws != NOT_FINITE
