from hil.contract.messages import Belief, Stage, VehicleState
from hil.nodes.policy import PolicyNode
from policies.task.interface import Command
from tests.unit.hil.contract.node_fakes import filled


class FakePolicy:
    """Notes what it is given; engages from its third step on."""

    def __init__(self):
        self.resets, self.seen = [], []

    def reset(self, now_ns):
        self.resets.append(now_ns)

    def step(self, now_ns, vehicle, board):
        self.seen.append((now_ns, vehicle, board))
        return Command(len(self.seen) > 2, (0.1, 0.2, 0.3), 9.0 + len(self.seen), "dive", 1.1)


BELIEF = Belief(0, True, (1.0, 2.0, 3.0), 0.1, 0.2, 0.3, 0.4, 0.5, 77, 8, 9, (0.0,) * 8, 0.6, 4, 0.01)
ODOMETRY = VehicleState(0, (0.0, 0.0, 2.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)


def step(node, now_ns, stage="attempt", belief=BELIEF, odometry=ODOMETRY):
    messages = [("belief", belief), ("vehicle/odometry", odometry), ("run/stage", Stage(0, stage, 0, 0))]
    inbox = filled(node, *[(topic, message) for topic, message in messages if message is not None])
    return [out.message for out in node.step(now_ns, inbox)]


def test_policy_node_steps_with_every_belief():
    assert PolicyNode(FakePolicy()).wakes == ("belief",)


def test_policy_node_acts_on_a_picture_between_ticks():
    policy = FakePolicy()
    node = PolicyNode(policy)
    inbox = filled(node, ("belief", BELIEF), ("vehicle/odometry", ODOMETRY), ("run/stage", Stage(0, "attempt", 0, 0)))
    assert len(node.step(500, inbox)) == 1
    inbox.clear()
    inbox.put("belief", BELIEF)
    assert len(node.step(506, inbox)) == 1
    assert [now for now, _, _ in policy.seen] == [500, 506]


def test_before_the_attempt_the_policy_is_not_stepped():
    policy = FakePolicy()
    node = PolicyNode(policy)
    for stage in ("prepare", "lead", "ended"):
        assert step(node, 0, stage) == []
    assert step(node, 0, belief=None) == []
    assert step(node, 0, odometry=None) == []
    assert (policy.resets, policy.seen) == ([], [])


def test_policy_is_reset_once_and_receives_odometry_and_belief():
    policy = FakePolicy()
    node = PolicyNode(policy)
    actions = [step(node, now)[0] for now in (500, 600, 700)]
    assert policy.resets == [500]
    assert policy.seen == [(now, ODOMETRY, BELIEF) for now in (500, 600, 700)]
    assert [action.engaged for action in actions] == [False, False, True]
    last = actions[-1]
    assert (last.stamp_ns, last.body_rate, last.thrust) == (700, (0.1, 0.2, 0.3), 12.0)
    assert (last.phase, last.exposure_ns, last.thrust_gain) == ("dive", 77, 1.1)
