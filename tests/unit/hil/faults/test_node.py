"""The decorator of a node: inputs, outputs, clock and wire change while a fault is active, and only then."""

import numpy as np
import pytest

from hil.contract.messages import Action, Detection, Faults, Image
from hil.contract.node import Inbox, Node, Out
from hil.contract.wire import memory_pair
from hil.faults.fault import Fault
from hil.faults.kinds import KINDS, read_parameters
from hil.faults.node import TOPIC, FaultyNode
from hil.faults.wire import FaultyWire, FaultyWires
from kernel.random import stream
from scenarios.faults import FaultTable

MS = 1_000_000


def fault(kind, **values) -> Fault:
    one = FaultTable.model_validate({"kind": kind, **values})
    return KINDS[kind](read_parameters(one), stream(1, 2))


class Publisher(Node):
    """Publishes one message a step on `topic`, made by `make(now_ns)`."""

    name = "publisher"

    def __init__(self, topic, make):
        self.outputs, self._topic, self._make = (topic,), topic, make
        self.times, self.why = [], ""

    def step(self, now_ns, inbox):
        self.times.append(now_ns)
        return [Out(self._topic, self._make(now_ns))]

    def abort(self, why):
        self.why = why


def decorated(node, *faults):
    return FaultyNode(lambda _: node, dict(enumerate(faults)), FaultyWires(None, faults))


def stepped(node, times, active):
    """Outputs of `node` at `times` (ms), with faults 0.. active within `active` (ms)."""
    inbox, outs = Inbox(node.inputs), []
    for t in times:
        on = active[0] <= t < active[1]
        inbox.put(TOPIC, Faults(t * MS, (0,) if on else (), (0,)))
        outs.append(node.step(t * MS, inbox))
        inbox.clear()
    return outs


def image(now_ns):
    pixels = (np.arange(12) * 20 + now_ns // MS).astype(np.uint8)
    return Image(now_ns, 4, 3, 1000, bytes(pixels), now_ns // MS)


def detection(now_ns):
    t = now_ns * 1e-9
    return Detection(now_ns, True, (t, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), 0.01, 0.01, (), (), "", now_ns // MS, 0)


def action(now_ns):
    return Action(now_ns, True, (now_ns * 1e-9, 0.0, 0.0), 9.8, "", now_ns, 1.0)


@pytest.mark.parametrize(
    ("kind", "topic", "make"),
    [
        ("camera.frozen", "camera/image", image),
        ("camera.frozen", "board/detection", detection),
        ("camera.late", "camera/image", image),
        ("camera.stamp", "camera/image", image),
        ("camera.dark", "camera/image", image),
        ("camera.overexposed", "camera/image", image),
        ("camera.intrinsics", "camera/image", image),
        ("detector.duplicate", "board/detection", detection),
        ("policy.nan", "policy/action", action),
        ("policy.frozen", "policy/action", action),
        ("policy.late", "policy/action", action),
    ],
)
def test_output_changes_while_the_fault_is_active_and_only_then(kind, topic, make):
    times = range(0, 100, 10)
    found = stepped(decorated(Publisher(topic, make), fault(kind)), times, (30, 60))
    plain = [[Out(topic, make(t * MS))] for t in times]
    differing = [t for t, a, b in zip(times, found, plain, strict=True) if repr(a) != repr(b)]
    first = 40 if "frozen" in kind else 30  # the picture that it keeps is the first one
    assert differing == list(range(first, 60, 10))


@pytest.mark.parametrize("kind", [kind for kind, fault in KINDS.items() if "camera" in fault.nodes])
def test_camera_with_a_fault_keeps_its_lookahead(kind):
    camera = Publisher("camera/image", image)
    camera.lookahead_ns = 16 * MS
    camera.step = lambda now_ns, inbox: [Out("camera/image", image(now_ns), 16 * MS)]
    node = decorated(camera, fault(kind))
    assert node.lookahead_ns == 16 * MS
    found = [out.delay_ns for outs in stepped(node, range(0, 60, 10), (0, 60)) for out in outs]
    assert found or kind == "camera.dropped"
    assert all(delay_ns >= 16 * MS for delay_ns in found)


def test_share_of_pictures_is_dropped_at_random_and_repeatably():
    def run():
        node = decorated(Publisher("camera/image", image), fault("camera.dropped", share=0.3))
        return [len(outs) for outs in stepped(node, range(1000), (0, 1000))]

    counts = run()
    assert counts == run() and 620 < sum(counts) < 780


def test_share_of_poses_is_off_at_random():
    node = decorated(Publisher("board/detection", detection), fault("detector.outlier", share=0.3))
    found = stepped(node, range(400), (0, 400))
    off = [t for t, outs in enumerate(found) if outs[0].message.position != detection(t * MS).position]
    assert 90 < len(off) < 150


def test_stalled_step_waits_and_then_gets_everything():
    class Counter(Node):
        name, inputs = "policy", ("belief",)

        def __init__(self):
            self.got = []

        def step(self, now_ns, inbox):
            self.got.append(list(inbox.new("belief")))
            return []

    inner = Counter()
    node = decorated(inner, fault("service.stalled"))
    inbox = Inbox(node.inputs)
    for t in range(6):
        inbox.put(TOPIC, Faults(t, (0,) if 2 <= t < 4 else (), (0,)))
        inbox.put("belief", t)
        node.step(t, inbox)
        inbox.clear()
    assert inner.got == [[0], [1], [2, 3, 4], [5]]


def test_clock_of_a_node_steps():
    inner = Publisher("camera/image", image)
    stepped(decorated(inner, fault("clock.step", offset_ms=200.0)), range(0, 40, 10), (20, 30))
    assert [t // MS for t in inner.times] == [0, 10, 220, 30]


def test_killed_service_is_not_stepped_and_obeys_nothing():
    inner = Publisher("camera/image", image)
    node = decorated(inner, fault("service.killed"))
    assert [len(outs) for outs in stepped(node, range(0, 50, 10), (20, 1000))] == [1, 1, 0, 0, 0]
    node.abort("lost")
    assert inner.why == ""


def test_permission_to_arm_reaches_the_node():
    inner = Publisher("camera/image", image)
    inner.permit = permitted = Permitted()
    decorated(inner, fault("mavlink.loss")).permit({"uid": "1"})
    assert permitted.tables == [{"uid": "1"}]


class Permitted:
    def __init__(self):
        self.tables = []

    def __call__(self, arming):
        self.tables.append(arming)


class Host:
    """Wires of a host on which an address can be opened once."""

    def __init__(self):
        self.opened = []

    def vehicle_system(self):
        return 3

    def vehicle_device(self):
        assert not self.opened, "address in use"
        self.opened.append(memory_pair(lambda: 0))
        return self.opened[-1][0]


def test_node_that_is_built_again_gets_the_wire_that_is_open():
    host = Host()
    wires = FaultyWires(host, [])
    wires.vehicle_device().send(b"a")
    wires.opened.clear()
    wires.vehicle_device().send(b"b")
    assert host.opened[0][1].receive() == [b"a", b"b"]
    assert wires.vehicle_system() == 3


def test_two_active_faults_act_one_after_the_other():
    node = decorated(Publisher("board/detection", detection), fault("detector.duplicate"), fault("camera.late"))
    inbox = Inbox(node.inputs)
    inbox.put(TOPIC, Faults(0, (0, 1), (0, 1)))
    outs = node.step(0, inbox)
    assert [out.delay_ns for out in outs] == [80 * MS, 80 * MS]


class Clock:
    now_ns = 0

    def __call__(self):
        return self.now_ns


@pytest.fixture
def link():
    """A faulty end and its plain peer, and what moves their clocks."""
    clock = Clock()
    end, peer = memory_pair(clock)

    def make(*faults):
        wire = FaultyWire(end, faults)
        wire.active = frozenset(faults)
        for one in faults:
            one.begin(None)

        def at(t_ms):
            clock.now_ns = wire.now_ns = round(t_ms * MS)
            for one in faults:
                one.now_ns = wire.now_ns

        at(0)
        return wire, peer, at

    return make


def test_wire_down_carries_nothing(link):
    wire, peer, _ = link(fault("mavlink.down"))
    wire.send(b"a")
    peer.send(b"b")
    assert peer.receive() == [] and wire.receive() == []


def test_wire_delays_both_ways(link):
    wire, peer, at = link(fault("mavlink.delay", delay_ms=20.0))
    wire.send(b"a")
    peer.send(b"b")
    assert wire.receive() == [] and peer.receive() == []
    at(19.9)
    wire.flush()
    assert wire.receive() == [] and peer.receive() == []
    at(20)
    wire.flush()
    assert wire.receive() == [b"b"] and peer.receive() == [b"a"]


def test_jitter_keeps_the_order_and_reordering_does_not(link):
    for kind, ordered in (("mavlink.jitter", True), ("mavlink.reordering", False)):
        wire, peer, at = link(fault(kind))
        got = []
        for t in range(0, 400, 2):
            at(t)
            if t < 200:
                wire.send(bytes([t]))
            wire.flush()
            got += peer.receive()
        assert len(got) == 100 and (got == sorted(got)) is ordered


def test_duplicates_and_corruption_change_a_share(link):
    wire, peer, at = link(fault("mavlink.duplicates", share=1.0, delay_ms=5.0))
    wire.send(b"a")
    at(5)
    wire.flush()
    assert peer.receive() == [b"a", b"a"]
    wire, peer, at = link(fault("mavlink.corruption", share=1.0))
    wire.send(bytes(20))
    wire.flush()
    (got,) = peer.receive()
    assert len(got) == 20 and 1 <= sum(map(bool, got)) <= 2


def test_bus_off_refuses_what_is_sent(link):
    wire, peer, _ = link(fault("can.bus_off"))
    assert wire.send((0x111, bytes(8))) is False and peer.receive() == []


def test_wire_without_an_active_fault_is_the_wire(link):
    wire, peer, _ = link(fault("mavlink.down"))
    wire.active = frozenset()
    wire.send(b"a")
    peer.send(b"b")
    assert peer.receive() == [b"a"] and wire.receive() == [b"b"]
