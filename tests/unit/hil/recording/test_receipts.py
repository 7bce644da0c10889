"""Receipts record what each step consumed, and a replay with them finds every change and no other."""

import json
from dataclasses import replace

import pytest

from hil.contract import messages as m
from hil.contract.node import Node, Out
from hil.host.lockstep import Clock, Lockstep
from hil.host.replay import _compare, _difference, _replay_node
from hil.recording.reader import Recording
from hil.recording.receipts import Receipt, ReceiptBook, read_receipts
from hil.recording.recorder import Recorder, RecordingError


class Source(Node):
    """Publishes odometry every 4 ms, some of it late."""

    name, inputs, outputs, wakes, period_ns = "source", (), ("vehicle/odometry",), (), 4_000_000

    def __init__(self):
        self.count = 0

    def step(self, now_ns, inbox):
        self.count += 1
        state = m.VehicleState(now_ns, (float(self.count), 0.0, 1.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
        return [Out("vehicle/odometry", state, 3_000_000 if self.count % 3 == 0 else 0)]


class Summer(Node):
    """Adds up what it has seen: any input too many, too few or out of place shows in all that follows."""

    name, inputs, outputs, wakes, period_ns = "belief", ("vehicle/odometry",), ("belief",), (), 10_000_000

    def __init__(self, gain=1.0):
        self.sum, self.gain = 0.0, gain

    def step(self, now_ns, inbox):
        for state in inbox.new("vehicle/odometry"):
            self.sum = 0.9 * self.sum + self.gain * state.position[0]
        place = (self.sum, 0.0, 0.0)
        return [Out("belief", m.Belief(now_ns, True, place, 0.0, 0.0, 0.0, 0.0, 1.0, 0, 0, 0, (), 0.0, 0, 0.01))]


@pytest.fixture
def run(tmp_path):
    nodes, clock = [Source(), Summer()], Clock()
    book = ReceiptBook(tmp_path / "receipts.mcap", nodes)
    with Recorder(tmp_path / "run.mcap") as recorder:
        host = Lockstep(nodes, clock, recorder, book=book)
        host.run(lambda now: now >= 300_000_000)
    book.close()
    return tmp_path


def replayed(run, node, tolerance=0.0, ignored=(), numbers=None):
    _, steps = read_receipts(run)["belief"]
    (found,) = _replay_node(node, steps, Recording(run / "run.mcap"), numbers or {}, set(ignored), tolerance)
    return found


def test_receipts_count_every_message_once_and_in_order(run):
    inputs, steps = read_receipts(run)["belief"]
    assert inputs == ("vehicle/odometry",)
    assert [step.stamp_ns for step in steps] == list(range(0, 300_000_000 + 1, 10_000_000))
    numbers = [number for step in steps for number in step.consumed[1:]]
    assert numbers == list(range(len(numbers)))
    assert all(step.consumed[0] == len(step.consumed) - 1 for step in steps)


def test_replay_with_unchanged_code_has_no_differences(run):
    found = replayed(run, Summer())
    assert (found.differing, found.first) == (0, "")
    assert found.compared == 31


def test_replay_reports_place_and_size_of_a_changed_output(run):
    found = replayed(run, Summer(gain=1.5))
    assert found.differing > 20
    assert "position was" in found.first
    assert found.largest > 1.0


def test_replay_accepts_differences_within_tolerance_or_in_ignored_fields(run):
    assert replayed(run, Summer(gain=1.0 + 1e-9), tolerance=1e-6).differing == 0
    assert replayed(run, Summer(gain=1.0 + 1e-9)).differing > 0
    assert replayed(run, Summer(gain=2.0), ignored=["belief.position"]).differing == 0


def test_replay_reports_a_node_that_publishes_fewer_messages(run):
    class Lazy(Summer):
        def step(self, now_ns, inbox):
            return super().step(now_ns, inbox) if now_ns < 200_000_000 else []

    found = replayed(run, Lazy())
    assert found.differing == 11
    assert "messages more" in found.first


def test_replay_reports_inputs_missing_in_the_recording(run):
    found = replayed(run, Summer(), numbers={"vehicle/odometry": {"first": 0, "missing": [5]}})
    assert found.differing > 0


def test_unwritable_receipts_raise_a_recording_error(tmp_path):
    with pytest.raises(RecordingError, match="receipts"):
        ReceiptBook(tmp_path / "nowhere" / "receipts.mcap", [])


def test_truncated_receipts_can_be_read_up_to_the_cut(run):
    path = run / "receipts.mcap"
    book = ReceiptBook(run / "receipts-cut.mcap", [Summer()])
    for number in range(3000):
        book.add("belief", number * 10_000_000, (1, number))
    path.unlink()  # the book was never closed, as if its process had been killed
    _, steps = read_receipts(run)["belief"]
    assert 2800 < len(steps) < 3000
    assert steps[100] == Receipt(1_000_000_000, (1, 100))
    book.close()


def test_nan_is_never_within_tolerance():
    action = m.Action(1, True, (0.0, 0.0, 0.0), 9.8, "go", 0, 1.0)
    nan = replace(action, thrust=float("nan"))
    assert _difference("policy/action", action, nan, set(), 1e9) is not None
    assert _difference("policy/action", nan, nan, set(), 0.0) is None
    assert _difference("policy/action", action, replace(action, phase="wait"), set(), 1e9) is not None


def test_replay_does_not_compare_unrecorded_topics():
    action = m.Action(1, True, (0.0, 0.0, 0.0), 9.8, "go", 0, 1.0)
    found = _compare("policy", "policy/action", {1: action}, [(0, action), (1, action)], set(), 0.0, 0)
    assert (found.compared, found.differing) == (1, 0)
    assert json.dumps(found.first) == '""'
