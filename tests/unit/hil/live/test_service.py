"""One process of a live run: what wakes a node, which health it reports, how it ends."""

import contextlib
import os
import socket
import threading
import time

import pytest

from hil.bus.leaf import CONTROL, HEALTH, Bus, Mailbox, open_hub
from hil.contract import messages as m
from hil.contract.node import Node, Out
from hil.live.liveness import Presence
from hil.live.run_clock import RunTime
from hil.live.service import LiveService
from hil.recording.recorder import RecordingError
from tests.unit.hil.bus.test_leaf import free_endpoint

LIMIT_S = 10.0


class Fake(Node):
    """A node that notes when and why it was stepped."""

    name, inputs, outputs, wakes = "policy", ("belief", "run/stage"), ("policy/action",), ("belief",)

    def __init__(self, period_ns=0, wire=None):
        self.period_ns, self.steps, self.aborts, self._wire = period_ns, [], [], wire
        self.at_rest = True

    def step(self, now_ns, inbox):
        self.steps.append((now_ns, len(inbox.new("belief")), len(inbox.new("run/stage"))))
        if self._wire is not None:
            with contextlib.suppress(BlockingIOError):
                self._wire.recv(100)
        return [Out("policy/action", m.Action(now_ns, False, (0.0, 0.0, 0.0), 9.81, "hold", 0, 9.81))]

    @property
    def safe(self):
        return self.at_rest

    def abort(self, why):
        self.aborts.append(why)


class Service:
    """A `LiveService` that runs in a thread, beside a supervisor's bus."""

    def __init__(self, node, endpoint, **more):
        self.bus, self.supervisor, self.health = Bus(endpoint), Bus(endpoint), []
        self.supervisor.on_table(HEALTH + "brain", self.health.append)
        self.live = LiveService("brain", [node], self.bus, RunTime(self.bus.clock()), **more)
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()
        until(lambda: any(table["state"] == "ready" for table in self.health))

    def _serve(self):
        if self.live.wait_for_go():
            self.live.run()
        self.live.close()

    def order(self, **table):
        self.supervisor.send_table(CONTROL, table)

    def go(self):
        self.order(order="go", epoch_ns=time.monotonic_ns())
        until(lambda: any(table["state"] == "running" for table in self.health))

    def end(self):
        self.order(order="stop", service="brain")
        self.thread.join(LIMIT_S)
        assert not self.thread.is_alive()
        self.bus.close()
        self.supervisor.close()


def until(condition, again=lambda: None):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        again()
        time.sleep(0.01)


@pytest.fixture
def start():
    endpoint, running = free_endpoint(), []

    def started(node, **more):
        running.append(Service(node, endpoint, **more))
        return running[-1]

    with open_hub(endpoint):
        yield started
        for service in running:
            service.end()


def test_node_wakes_on_wake_topics_only_and_then_receives_all_messages(start):
    node = Fake()
    service = start(node)
    service.go()
    for number in range(50):
        service.supervisor.publish(number, "run/stage", m.Stage(number, "lead", 0, 0))
    until(lambda: len(service.live._mailbox._queues.get("run/stage", ())) > 0)
    assert node.steps == []
    belief = m.Belief(1, True, (0.0, 0.0, 1.5), 0.0, 1.0, 0.0, 0.5, 1.0, 1, 1, 0, (1.0,), 0.0, 1, 0.01)
    until(lambda: node.steps, lambda: service.supervisor.publish(1, "belief", belief))
    until(lambda: sum(stages for _, _, stages in node.steps) > 0)


def test_data_on_a_wire_wakes_its_driver_before_its_period_ends(start, monkeypatch):
    monkeypatch.setattr("hil.live.schedule.WIRE_PERIOD_NS", 3600 * 10**9)
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    here.setblocking(False)
    node = Fake(period_ns=2_000_000, wire=here)
    service = start(node, descriptors={here.fileno(): "policy"})
    service.go()
    until(lambda: node.steps)
    for number in range(1, 6):  # the next hour has no other reason
        there.send(b"x")
        until(lambda number=number: len(node.steps) == 1 + number)
    service.end()
    service.end = lambda: None
    here.close()
    there.close()


def test_message_between_go_and_the_epoch_steps_no_node(start):
    node = Fake()
    service = start(node)
    service.order(order="go", epoch_ns=time.monotonic_ns() + 1_000_000_000)
    belief = m.Belief(1, True, (0.0, 0.0, 1.5), 0.0, 1.0, 0.0, 0.5, 1.0, 1, 1, 0, (1.0,), 0.0, 1, 0.01)
    until(lambda: node.steps, lambda: service.supervisor.publish(-1, "belief", belief))
    assert all(now_ns >= 0 for now_ns, _, _ in node.steps)


def test_periodic_node_without_a_wire_is_stepped_at_its_deadlines(start):
    node = Fake(period_ns=20_000_000)
    node.wakes = ()
    start(node).go()
    until(lambda: len(node.steps) >= 20)
    times = [now_ns for now_ns, _, _ in node.steps]
    assert all(now_ns % 20_000_000 == 0 for now_ns in times)
    assert times == sorted(set(times))


class Slow(Fake):
    """A node that cannot keep its period."""

    def step(self, now_ns, inbox):
        time.sleep(0.005)
        return super().step(now_ns, inbox)


def test_late_node_still_receives_and_publishes(start):
    node = Slow(period_ns=1_000_000)
    service = start(node)
    service.go()
    stage = m.Stage(1, "lead", 0, 0)
    until(lambda: any(stages for _, _, stages in node.steps), lambda: service.supervisor.publish(1, "run/stage", stage))
    service.health.clear()
    until(lambda: len(service.health) >= 2)
    assert service.health[-1]["nodes"]["policy"]["missed"] > 0


class FullDisk:
    """A receipt book on a disk that is full from the first step on."""

    def add(self, node, now_ns, consumed):
        raise RecordingError("writing receipts to receipts.mcap failed: No space left on device")

    def close(self):
        raise RecordingError("writing receipts to receipts.mcap failed: No space left on device")


def test_service_continues_to_the_safe_state_when_receipts_cannot_be_written(start):
    node, events = Fake(period_ns=20_000_000), Mailbox()
    service = start(node, book=FullDisk())
    service.supervisor.subscribe("supervisor", ["event"], events)
    service.go()
    until(lambda: len(node.steps) > 10)
    texts = []
    until(lambda: texts, lambda: texts.extend(one.message.text for one in events.drain()))
    assert texts == ["this run cannot be replayed: writing receipts to receipts.mcap failed: No space left on device"]
    service.order(order="abort", why="mocap was killed")
    until(lambda: node.aborts)
    service.end()  # closing the book fails too, and the thread still ends
    service.end = lambda: None
    events.close()


def test_service_continues_when_an_event_cannot_be_encoded(start):
    node, events = Fake(period_ns=20_000_000), Mailbox()
    broken = m.Event(1, "info", "policy", "\ud800")  # a surrogate, as of a damaged text of a device
    node.outputs = ("policy/action", "event")
    step = node.step
    node.step = lambda now_ns, inbox: [*step(now_ns, inbox), Out("event", broken)]
    service = start(node)
    service.supervisor.subscribe("supervisor", ["event"], events)
    service.go()
    texts = []
    until(lambda: texts, lambda: texts.extend(one.message.text for one in events.drain()))
    assert texts[0].startswith("a message could not be published: perch.Event.text")
    steps = len(node.steps)
    until(lambda: len(node.steps) > steps + 5)
    events.close()


def test_order_of_a_second_supervisor_is_not_obeyed_after_the_go(start):
    node, events = Fake(), Mailbox()
    service = start(node)
    service.supervisor.subscribe("supervisor", ["event"], events)
    service.go()
    texts = []
    until(
        lambda: texts,
        lambda: (
            service.order(order="abort", why="mine", session="other"),
            texts.extend(one.message.text for one in events.drain()),
        ),
    )
    assert texts[0].startswith('"abort" of a second supervisor was not obeyed')
    assert node.aborts == []
    events.close()


def test_second_process_of_a_service_ends_at_the_go(start, capfd):
    service = start(Fake())
    service.order(order="go", epoch_ns=time.monotonic_ns(), sessions={"brain": "0123456789abcdef"})
    service.thread.join(LIMIT_S)
    assert not service.thread.is_alive()
    assert service.live.lost
    assert "another process serves this run as brain" in capfd.readouterr().out


def test_second_publisher_of_an_input_is_reported_and_not_heard(start):
    node, events = Fake(), Mailbox()
    service = start(node)
    service.supervisor.subscribe("supervisor", ["event"], events)
    service.go()
    belief = m.Belief(1, True, (0.0, 0.0, 1.5), 0.0, 1.0, 0.0, 0.5, 1.0, 1, 1, 0, (1.0,), 0.0, 1, 0.01)
    until(lambda: node.steps, lambda: service.supervisor.publish(1, "belief", belief))
    texts = []
    until(
        lambda: texts,
        lambda: (
            service.bus.publish(1, "belief", belief),  # from another session
            texts.extend(one.message.text for one in events.drain()),
        ),
    )
    assert texts == ["belief comes from a second process too, and is not taken from it"]
    events.close()


def test_abort_reaches_every_node_once(start, capfd):
    node = Fake()
    service = start(node)
    service.go()
    for _ in range(3):
        service.order(order="abort", why="mocap was killed")
    until(lambda: any(table["state"] == "aborted" for table in service.health))
    assert node.aborts == ["mocap was killed"]
    assert service.health[-1]["why"] == "mocap was killed"
    service.end()
    service.end = lambda: None
    assert "brain: safe at the end" in capfd.readouterr().out


def test_service_without_orders_enters_the_safe_state_and_exits(start, capfd):
    now = [time.monotonic_ns()]
    presence = Presence(clock=lambda: now[0], parent=os.getppid)
    node = Fake()
    service = start(node, presence=presence)
    service.go()
    now[0] += 10_000_000_000
    service.thread.join(LIMIT_S)
    assert not service.thread.is_alive()
    assert service.live.lost
    assert len(node.aborts) == 1
    assert "nothing received from supervisor and hub for 10.0 s" in node.aborts[0]


def test_service_not_yet_safe_does_not_exit(start):
    now = [time.monotonic_ns()]
    node = Fake()
    node.at_rest = False
    service = start(node, presence=Presence(clock=lambda: now[0], parent=os.getppid))
    service.go()
    now[0] += 10_000_000_000
    until(lambda: node.aborts)
    service.thread.join(2.0)
    assert service.thread.is_alive()
    node.at_rest = True
    service.thread.join(LIMIT_S)
    assert not service.thread.is_alive()


def test_nodes_learn_what_may_be_armed_before_their_first_step(start):
    node = Fake(period_ns=2_000_000)
    permitted = []
    node.permit = lambda arming: permitted.append((arming, len(node.steps)))
    service = start(node)
    service.order(order="go", epoch_ns=time.monotonic_ns(), arming={"uid": "4954"})
    until(lambda: node.steps)
    assert permitted == [({"uid": "4954"}, 0)]
