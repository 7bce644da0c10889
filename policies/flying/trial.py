"""A network on recorded observations, before it may fly: what it answers, how fast, and how far from another.

The observations are of flights of the shipped network, so that they are such as a flight gives. They come with the
project (`observations.npz`, made by tests/unit/policies/flying/record_observations.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from policies.flying.contract import ActionContract, ContractError
from policies.flying.onnx_file import OpenedPolicy
from policies.task.observation import LAYOUT_NAME, LAYOUT_VERSION, OBS_DIM
from vehicle.quadrotor import command_row

OBSERVATIONS = Path(__file__).with_name("observations.npz")
STRIDE = 8  # of the histories in them: the shipped network's
SLOWEST = 2e-3  # s, median time of one answer: a fifth of the control period; the shipped networks take a tenth of it
_TIMED, _SOME = 60, 8  # observations answered by themselves: for the time, for the comparison with a batch
_BEYOND = 1e-6  # of an action in [-1, 1]: rounding
_SAME = 1e-3  # of actions on the same observation, alone and in a batch


@dataclass(frozen=True)
class Distance:
    """How far the commands of two networks are from each other on the recorded observations, median and largest.

    `rate`: rad/s, of the body axis where they differ most; `thrust`: m/s^2.
    """

    rate: tuple[float, float]
    thrust: tuple[float, float]


@cache
def recorded_observations() -> np.ndarray:
    """The (N, OBS_DIM) float32 recorded observations."""
    with np.load(OBSERVATIONS, allow_pickle=False) as data:
        layout, found = (str(data["layout"]), int(data["version"])), data["observations"]
    if layout != (LAYOUT_NAME, LAYOUT_VERSION) or found.shape[1:] != (OBS_DIM,):
        raise ValueError(f"{OBSERVATIONS} holds observations of another layout: record them again")
    return found


def try_policy(policy: OpenedPolicy) -> np.ndarray:
    """A network's (N, 4) answers to the recorded observations, in [-1, 1].

    Raises ContractError for answers that are not (N, 4), not finite, outside [-1, 1], not the same twice or not the
    same alone as in a batch.
    """
    name, observations = _called(policy), recorded_observations()
    actions = _answers(name, policy, observations)
    if not np.isfinite(actions).all():
        bad = np.count_nonzero(~np.isfinite(actions).all(axis=1))
        raise ContractError(f"{name} answers with numbers that are not finite to {bad} of {len(actions)} observations")
    largest = float(np.abs(actions).max())
    if largest > 1.0 + _BEYOND:
        raise ContractError(
            f"{name} answers with {largest:.3g}; actions are in [-1, 1], scaled by the contract's limits"
        )
    if not np.array_equal(actions, policy.run(observations)):
        raise ContractError(f"{name} does not answer the same twice: it draws random numbers")
    some = observations[:_SOME]
    alone = np.concatenate([policy.run(one[None]) for one in some])
    if not np.abs(alone - actions[: len(some)]).max() <= _SAME:
        raise ContractError(f"{name} answers otherwise alone than in a batch: its rows depend on each other")
    return actions


def latency(policy: OpenedPolicy, stopwatch: Callable[[], float]) -> float:
    """Median time of one answer to a recorded observation, s, by `stopwatch` (s). Raises ContractError if it is over
    SLOWEST: such a policy cannot keep the control rate on this computer."""
    times = []
    for one in recorded_observations()[:_TIMED]:
        begun = stopwatch()
        policy.run(one[None])
        times.append(stopwatch() - begun)
    found = float(np.median(times))
    if found > SLOWEST:
        raise ContractError(
            f"{_called(policy)} takes {1e3 * found:.1f} ms for an answer on this computer, {1e3 * SLOWEST:g} ms are "
            "allowed; use a smaller network"
        )
    return found


def distance(actions: np.ndarray, others: np.ndarray, limits: ActionContract) -> Distance:
    """How far two networks' actions (N, 4) of the same `limits` are from each other."""
    apart = np.abs(actions.astype(np.float64) - others)
    rate = limits.rate_max * apart[:, : command_row.THRUST].max(axis=1)
    thrust = 0.5 * (limits.thrust_max - limits.thrust_min) * apart[:, command_row.THRUST]
    return Distance(*((float(np.median(found)), float(found.max())) for found in (rate, thrust)))


def _called(policy: OpenedPolicy) -> str:
    return f"policy '{policy.contract.name}'"


def _answers(name: str, policy: OpenedPolicy, observations: np.ndarray) -> np.ndarray:
    try:
        actions = policy.run(observations)
        one = policy.run(observations[:1])
    except Exception as error:  # onnxruntime raises a family of bare exceptions for what a graph cannot compute
        reason = " ".join(str(error).split())[:160]
        raise ContractError(f"{name} cannot be run on recorded observations ({reason}); export it again") from None
    for found, count in ((actions, len(observations)), (one, 1)):
        shape = np.shape(found)
        if shape != (count, command_row.DIM):
            raise ContractError(
                f"{name} answers {count} observations with {' x '.join(map(str, shape)) or 'one number'} numbers, not "
                f"{count} x {command_row.DIM}"
            )
    return actions
