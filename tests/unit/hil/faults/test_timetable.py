"""The timetable: a fault begins when its condition is true for the first time, and ends when its time is over."""

from itertools import pairwise

from hil.contract.messages import BoardState, Detection, Faults, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from hil.faults.node import TOPIC
from hil.faults.timetable import Timetable
from scenarios.faults import FaultTable

MS = 1_000_000
LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


class Director(Node):
    """Opens the attempt at 100 ms."""

    name, inputs, outputs, period_ns = (
        "director",
        ("vehicle/status", "referee/contact"),
        ("run/stage", "event"),
        10 * MS,
    )

    def step(self, now_ns, inbox):
        return [Out("run/stage", Stage(now_ns, "attempt" if now_ns >= 100 * MS else "lead", 100 * MS, 0))]


def flown(tables, put=lambda t, inbox: None, until=500):
    """Time (ms) -> (active, begun) of every message of the timetable, and the texts of its events."""
    node = Timetable(Director(), [FaultTable.model_validate(table) for table in tables])
    inbox, states, texts = Inbox(node.inputs), {}, []
    for t in range(0, until, 10):
        put(t, inbox)
        for out in node.step(t * MS, inbox):
            if out.topic == TOPIC:
                message: Faults = out.message
                states[t] = (message.active, message.begun)
            elif out.topic == "event":
                texts.append((t, out.message.text))
        inbox.clear()
    return states, texts


def test_fault_at_seconds_of_the_attempt_lasts_its_time():
    states, texts = flown([{"kind": "camera.frozen", "at": 0.05, "for": 0.1}])
    assert texts == [(150, "fault camera.frozen begins"), (250, "fault camera.frozen ends")]
    assert all(active == ((0,) if 150 <= t < 250 else ()) for t, (active, _) in states.items())
    assert states[490 // 50 * 50] == ((), (0,))


def test_fault_without_a_duration_lasts_to_the_end():
    states, _ = flown([{"kind": "camera.frozen", "at": 0.0}])
    assert list(states.values())[-1] == ((0,), (0,))


def test_condition_that_never_comes_true_begins_nothing():
    states, texts = flown([{"kind": "camera.frozen", "at": 'stage == "ended"'}])
    assert not texts and all(state == ((), ()) for state in states.values())


def test_conditions_read_motion_capture_and_detections():
    def put(t, inbox):
        inbox.put("mocap/vehicle", VehicleState(t * MS, (t * 1e-2, 0.0, 2.0), ZERO, LEVEL, ZERO))
        inbox.put("mocap/board", BoardState(t * MS, (4.0, 0.0, 2.0), ZERO, LEVEL, 0.0, 0.0, 0.0))
        if t % 20 == 0:
            inbox.put("board/detection", Detection(t * MS, True, ZERO, LEVEL, 0, 0, (), (), "", 0, 0))

    _, texts = flown(
        [
            {"kind": "camera.frozen", "at": "distance < 1.95"},
            {"kind": "camera.late", "at": "detections >= 5"},
        ],
        put,
    )
    assert texts == [(180, "fault camera.late begins"), (210, "fault camera.frozen begins")]


def test_state_is_published_again_for_readers_that_missed_it():
    states, _ = flown([{"kind": "camera.frozen", "at": 9.0}])
    times = list(states)
    assert max(b - a for a, b in pairwise(times)) <= 50
