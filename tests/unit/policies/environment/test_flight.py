"""A recorded training episode through the flight's own classes: the same belief, observation and commands."""

from dataclasses import replace

import numpy as np
import pytest

from policies.environment import episode_row
from policies.environment.config import EnvConfig
from policies.environment.flight import EnvFlight
from policies.estimation.board_filter import BoardFilter
from policies.flying.guided import GuidedPolicy
from policies.flying.onnx_file import open_policy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.shipped import policy_file
from policies.guidance.guide import ALIGNED, BRAKED, FLARED
from policies.guidance.params import GuidanceParams
from policies.task.observation import action_from_command

STATE = policy_file("state")


CONFIG = EnvConfig(
    stage="vision", speed=(0.5, 1.5), inclination_deg=(0.0, 40.0), detector_hz=(60.0, 60.0), latency=(0.02, 0.025)
)


def test_flight_observations_equal_training_observations():
    """Detections as they arrive, odometry with its noise, the thrust gain learnt on the way: every tick, to the end."""
    blind = sum(fly_both(seed) for seed in (3, 7, 9))
    assert blind > 15  # the flare takes the board out of view, so the prediction alone was compared too


def test_guided_flight_equals_guided_training():
    """The same laws act, at every tick, on the same numbers; the network observes the command that was flown."""
    acted = [laws for seed in (3, 7, 9) for laws in fly_guided(seed)]
    assert {ALIGNED, FLARED, BRAKED} <= {bit for laws in acted for bit in (1, 2, 4) if laws & bit}
    assert sum(map(bool, acted)) > 30


def fly_guided(seed):
    """One guided episode, each tick compared; returns what acted. The laws ask for more than the network's own."""
    flight, board = EnvFlight(replace(CONFIG, seed=seed, guidance=True)), BoardFilter()
    env = flight.env
    rows = env.rows
    params = GuidanceParams.of(
        env.airframe, lean=0.25, impact_speed=0.2, flare_rate=1.0, flare_closing=0.2, sigma_high=0.05, sliding_high=3.0
    )
    env.shared = env.shared._replace(guidance=params.row())
    policy = GuidedPolicy(OnnxPolicy(open_policy(STATE), env.airframe), env.airframe, params)
    policy.reset(-10_000_000)
    acted = []
    while not flight.done and len(acted) < 300:
        for seen in flight.detections():
            board.update(seen.exposure_ns, seen.position, seen.orientation, seen.position_sigma, seen.orientation_sigma)
        estimate = board.estimate(flight.now_ns)._replace(valid=True)
        trained = policy._policy._network.run(rows.observation)[0]
        command = policy.step(flight.now_ns, flight.odometry(), estimate)
        asked = np.zeros(4)
        action_from_command(np.array([*command.asked_rate, command.asked_thrust]), env.shared.limits, asked)
        assert asked == pytest.approx(trained, abs=1e-5)
        acted.append(command.laws)
        flight.act(command._replace(body_rate=command.asked_rate, thrust=command.asked_thrust))
        if not flight.done:
            flown = [*command.body_rate, command.thrust]
            assert rows.state[0, episode_row.COMMAND : episode_row.COMMAND + 4] == pytest.approx(flown, abs=1e-5)
            assert rows.observation[0, -7:-3] == pytest.approx(
                rows.state[0, episode_row.ACTION : episode_row.ACTION + 4], abs=1e-6
            )
    assert len(acted) > 80
    return acted


def fly_both(seed):
    """One episode, each tick compared; returns how many had seen nothing for a while."""
    flight, board = EnvFlight(replace(CONFIG, seed=seed)), BoardFilter()
    rows = flight.env.rows
    policy = OnnxPolicy(open_policy(STATE), flight.env.airframe)
    policy.reset(-10_000_000)  # the gain's estimate has seen the tick before, as in training
    ticks = blind = 0
    while not flight.done and ticks < 300:
        for seen in flight.detections():
            measured = seen.exposure_ns, seen.position, seen.orientation, seen.position_sigma, seen.orientation_sigma
            assert board.update(*measured) in ("accepted", "gated")
        estimate = board.estimate(flight.now_ns)
        believed = [*estimate.position, estimate.heading, estimate.speed, estimate.turn_rate, estimate.inclination]
        assert believed == pytest.approx(rows.believed[0, :7], abs=1e-5)
        trained = policy._network.run(rows.observation)[0]
        estimate = estimate._replace(valid=True)  # training acts on the first detection, a flight waits for some
        command = policy.step(flight.now_ns, flight.odometry(), estimate)
        flown = np.zeros(4)
        action_from_command(np.array([*command.body_rate, command.thrust]), flight.env.shared.limits, flown)
        assert flown == pytest.approx(trained, abs=1e-5)
        blind += estimate.rho < 0.9
        flight.act(command)
        ticks += 1
    assert ticks > 80
    return blind


def test_flight_of_state_stage_or_warm_start_is_refused():
    with pytest.raises(ValueError, match="vision stage"):
        EnvFlight(EnvConfig(stage="state"))
    with pytest.raises(ValueError, match="warm"):
        EnvFlight(EnvConfig(stage="vision", warm=0.5))
