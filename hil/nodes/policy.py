"""The policy slot: belief and odometry in, body rates and thrust out. It has no other inputs."""

from __future__ import annotations

from hil.contract.messages import Action, Belief, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from policies.task.interface import FlyingPolicy


class PolicyNode(Node):
    """Steps a policy whenever a new belief arrives during the attempt; before that it is not stepped.

    A picture is not kept waiting for the next control tick.
    """

    name = "policy"
    inputs = ("belief", "vehicle/odometry", "run/stage")
    outputs = ("policy/action",)
    wakes = ("belief",)

    def __init__(self, policy: FlyingPolicy) -> None:
        self._policy = policy
        self._started = False

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        belief: Belief | None = inbox.latest("belief")
        odometry: VehicleState | None = inbox.latest("vehicle/odometry")
        stage: Stage | None = inbox.latest("run/stage")
        if belief is None or odometry is None or stage is None or stage.name != "attempt":
            return []
        if not self._started:
            self._policy.reset(now_ns)
            self._started = True
        command = self._policy.step(now_ns, odometry, belief)
        action = Action(
            stamp_ns=now_ns,
            engaged=command.engaged,
            body_rate=command.body_rate,
            thrust=command.thrust,
            phase=command.phase,
            exposure_ns=belief.last_exposure_ns,
            thrust_gain=command.thrust_gain,
            asked_rate=command.asked_rate or (0.0, 0.0, 0.0),
            asked_thrust=command.asked_thrust or 0.0,
            laws=command.laws,
        )
        return [Out("policy/action", action)]
