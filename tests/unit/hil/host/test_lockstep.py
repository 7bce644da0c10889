import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.contract.node import Out
from hil.host.lockstep import Clock, Lockstep
from tests.unit.hil.contract.node_fakes import FakeNode, publisher

STOP = 1_000


PATIENCE_S = 60


def run(nodes, stop=STOP, threads=1):
    """(what the tap saw, the time reached)."""
    seen, clock = [], Clock()
    host = Lockstep(nodes, clock, lambda *published: seen.append(published), threads=threads)
    return seen, host.run(lambda now_ns: now_ns >= stop)


def test_nodes_of_one_instant_step_in_the_graphs_order():
    order = []
    nodes = [
        FakeNode(name, period_ns=period, act=lambda now, _, name=name: order.append((now, name)) or [])
        for name, period in (("c", 20), ("a", 10), ("b", 20))
    ]
    run(nodes, 40)
    assert order[:8] == [(0, "c"), (0, "a"), (0, "b"), (10, "a"), (20, "c"), (20, "a"), (20, "b"), (30, "a")]


def test_a_message_reaches_later_nodes_at_once_and_earlier_ones_at_their_next_step():
    early = FakeNode("early", inputs=("t",), period_ns=10)
    late = FakeNode("late", inputs=("t",), period_ns=10)
    run([early, publisher("p", "t", 10), late], 20)
    assert early.steps == [(0, {}), (10, {"t": [("p", 0)]}), (20, {"t": [("p", 10)]})]
    assert late.steps == [(0, {"t": [("p", 0)]}), (10, {"t": [("p", 10)]}), (20, {"t": [("p", 20)]})]


def test_a_delayed_message_arrives_after_its_delay_even_between_ticks():
    reader = FakeNode("reader", inputs=("t",), wakes=("t",))
    seen, _ = run([publisher("p", "t", 10, delay_ns=7), reader], 20)
    assert seen == [(7, "t", ("p", 0)), (17, "t", ("p", 10))]
    assert reader.steps == [(7, {"t": [("p", 0)]}), (17, {"t": [("p", 10)]})]


def test_delayed_message_is_available_to_a_later_node_at_the_same_instant():
    reader = FakeNode("reader", inputs=("t",), period_ns=10)
    run([publisher("p", "t", 50, delay_ns=10), reader], 10)
    assert reader.steps == [(0, {}), (10, {"t": [("p", 0)]})]


def test_message_with_a_shorter_delay_arrives_first():
    delays = iter([30, 5, 1])
    sender = FakeNode("s", outputs=("t",), period_ns=10, act=lambda now, _: [Out("t", now, next(delays, 100))])
    seen, _ = run([sender, FakeNode("r", inputs=("t",))], 40)
    assert [(now, message) for now, _, message in seen] == [(15, 10), (21, 20), (30, 0)]


def test_woken_nodes_step_at_once_in_graph_order_with_the_message():
    a = FakeNode("a", inputs=("t",), wakes=("t",))
    b = FakeNode("b", inputs=("t",), wakes=("t",))
    order = []
    a.act = lambda now, inbox: order.append("a") or []
    b.act = lambda now, inbox: order.append("b") or []
    run([a, publisher("p", "t", 10), b], 0)
    assert order == ["a", "b"]
    assert a.steps == b.steps == [(0, {"t": [("p", 0)]})]


def test_a_chain_of_wakes_ends_within_the_instant():
    relay = FakeNode("relay", ("t",), ("u",), wakes=("t",), act=lambda now, _: [Out("u", now)])
    end = FakeNode("end", ("u",), wakes=("u",))
    seen, _ = run([publisher("p", "t", 10), relay, end], 10)
    assert [(now, topic) for now, topic, _ in seen] == [(0, "t"), (0, "u"), (10, "t"), (10, "u")]
    assert [now for now, _ in end.steps] == [0, 10]


def test_all_of_a_step_is_published_before_the_nodes_that_it_wakes_wake_its_node_again():
    states = iter("12")

    def act(now, inbox):
        state = Out("state", next(states))
        return [state] if inbox.new("command") else [Out("odometry", now), state]

    link = FakeNode(
        "link", inputs=("command",), outputs=("odometry", "state"), wakes=("command",), period_ns=STOP, act=act
    )
    policy = FakeNode("policy", inputs=("odometry",), outputs=("command",), wakes=("odometry",),
                      act=lambda now, _: [Out("command", now)])  # fmt: skip
    seen, _ = run([link, policy], 0)
    assert [(topic, message) for _, topic, message in seen] == [
        ("odometry", 0), ("state", "1"), ("command", 0), ("state", "2"),
    ]  # fmt: skip


def test_step_clears_new_messages_and_keeps_the_latest():
    latest = []
    reader = FakeNode("r", ("t",), period_ns=10, act=lambda now, inbox: latest.append(inbox.latest("t")) or [])
    run([publisher("p", "t", 30), reader], 30)
    assert [seen for _, seen in reader.steps] == [{"t": [("p", 0)]}, {}, {}, {"t": [("p", 30)]}]
    assert latest == [("p", 0), ("p", 0), ("p", 0), ("p", 30)]


def test_the_last_instant_is_finished_before_the_run_ends():
    nodes = [FakeNode(name, period_ns=10) for name in "abc"]
    asked, clock = [], Clock()
    host = Lockstep(nodes, clock, lambda *_: None)
    end = host.run(lambda now_ns: asked.append(now_ns) or now_ns >= 30)
    assert end == clock() == 30
    assert asked == [0, 10, 20, 30], "once an instant"
    assert all([now for now, _ in node.steps] == [0, 10, 20, 30] for node in nodes)


def test_nodes_read_the_hosts_clock():
    clock, read = Clock(), []
    node = FakeNode("n", period_ns=7, act=lambda now_ns, _: read.append(now_ns == clock()) or [])
    Lockstep([node], clock, lambda *_: None).run(lambda now_ns: now_ns >= 70)
    assert len(read) == 11
    assert all(read)


def test_run_without_periodic_nodes_ends_without_steps():
    assert run([FakeNode("n", ("t",), wakes=("t",))]) == ([], 0)


def test_a_nodes_exception_is_not_swallowed():
    def broken(now_ns, inbox):
        raise RuntimeError("driver lost")

    with pytest.raises(RuntimeError, match="driver lost"):
        run([FakeNode("n", period_ns=10, act=broken)])


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 60), st.booleans()), min_size=1, max_size=5))
def test_any_graph_is_reproducible_with_monotonic_time_and_kept_delays(spec):
    def graph():
        nodes = [publisher(f"p{i}", f"t{i}", period, delay) for i, (period, delay, _) in enumerate(spec)]
        for i, (_, _, wakes) in enumerate(spec):
            nodes.insert(i, FakeNode(f"r{i}", (f"t{i}",), wakes=(f"t{i}",) if wakes else (), period_ns=13))
        return nodes

    nodes, again = graph(), graph()
    seen, end = run(nodes, 200)
    assert (seen, end) == run(again, 200)
    assert [node.steps for node in nodes] == [node.steps for node in again]
    times = [now for now, _, _ in seen]
    assert times == sorted(times)
    for i, (period, delay, _) in enumerate(spec):
        mine = [(now, message[1]) for now, topic, message in seen if topic == f"t{i}"]
        assert mine == [(t + delay, t) for t in range(0, end + 1, period) if t + delay <= end]


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.integers(1, 20), st.integers(0, 20), st.lists(st.integers(0, 20), max_size=3), st.booleans()),
        min_size=1, max_size=4,
    )
)  # fmt: skip
def test_any_graph_is_the_same_on_two_threads(spec):
    """Periods, lookaheads and delays of small numbers, so that many times are equal."""

    def graph():
        nodes = []
        for i, (period, lookahead, delays, wakes) in enumerate(spec):
            before = f"t{i - 1}" if i else "t"
            inputs = (f"t{i}", before) if before in [topic for node in nodes for topic in node.outputs] else (f"t{i}",)
            outs = [(f"t{i}", lookahead + delay) for delay in delays]
            node = FakeNode(f"n{i}", inputs, (f"t{i}",), inputs[1:] if wakes else (), period, lookahead_ns=lookahead)
            node.act = lambda now, inbox, node=node, outs=outs: [
                Out(topic, (node.name, now, len(inbox.new(node.inputs[0])), inbox.latest(node.inputs[-1])), delay)
                for topic, delay in outs
            ]
            nodes.append(node)
        return nodes

    one, two = graph(), graph()
    assert run(one, 100) == run(two, 100, threads=2)
    assert [node.steps for node in one] == [node.steps for node in two]


def test_nodes_step_on_while_a_step_with_a_lookahead_is_computed():
    reached = threading.Event()
    slow = FakeNode("slow", outputs=("t",), period_ns=STOP, lookahead_ns=10)
    slow.act = lambda now, _: [Out("t", reached.wait(PATIENCE_S), 10)]
    other = FakeNode("other", period_ns=9)
    other.act = lambda now, _: (reached.set() if now else None) or []
    seen, _ = run([slow, other], 20, threads=2)
    assert seen == [(10, "t", True)]


def test_step_on_the_second_thread_does_not_see_later_messages():
    later = threading.Event()
    reader = FakeNode("reader", ("t",), ("u",), period_ns=STOP, lookahead_ns=50)
    reader.act = lambda now, inbox: [Out("u", (later.wait(PATIENCE_S), list(inbox.new("t")), inbox.latest("t")), 50)]
    source = FakeNode("source", outputs=("t",), period_ns=10)
    source.act = lambda now, _: ((later.set() if now >= 20 else None) or []) + [Out("t", now)]
    seen, _ = run([source, reader], 60, threads=2)
    assert [message for _, topic, message in seen if topic == "u"] == [(True, [0], 0)]


def test_only_nodes_with_a_lookahead_leave_the_calling_thread():
    threads = {}

    def graph():
        return [
            FakeNode(f"{ahead}", period_ns=10, lookahead_ns=ahead,
                     act=lambda now, _, ahead=ahead: threads.__setitem__(ahead, threading.current_thread()) or [])
            for ahead in (0, 5)
        ]  # fmt: skip

    here = threading.current_thread()
    run(graph(), 20)
    assert threads == {0: here, 5: here}
    run(graph(), 20, threads=2)
    assert threads[0] is here and threads[5] is not here
    assert not threads[5].is_alive(), "it ends with the run"


@pytest.mark.parametrize("stop", [5, 50])
def test_exception_of_a_step_on_the_second_thread_is_raised_before_or_after_it_is_due(stop):
    def broken(now_ns, inbox):
        raise RuntimeError("no picture")

    nodes = [FakeNode("n", period_ns=STOP, lookahead_ns=20, act=broken), FakeNode("o", period_ns=1)]
    with pytest.raises(RuntimeError, match="no picture"):
        run(nodes, stop, threads=2)


def test_interrupted_run_ends_with_its_step_under_way_finished():
    begun, finished = threading.Event(), []

    def slow(now_ns, inbox):
        begun.set()
        finished.append(now_ns)
        return []

    def interrupt(now_ns, inbox):
        assert begun.wait(PATIENCE_S)
        raise KeyboardInterrupt

    nodes = [FakeNode("n", period_ns=STOP, lookahead_ns=20, act=slow), FakeNode("o", period_ns=1, act=interrupt)]
    with pytest.raises(KeyboardInterrupt):
        run(nodes, threads=2)
    assert finished == [0]


def test_message_within_its_nodes_lookahead_is_an_error():
    with pytest.raises(RuntimeError, match="'p' publishes 't' within its lookahead"):
        run([publisher("p", "t", 30, delay_ns=9, lookahead_ns=10)], threads=2)
