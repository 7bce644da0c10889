"""Plain nodes and inboxes for the tests of graph, host and adapters."""

from hil.contract.node import Inbox, Node, Out


class FakeNode(Node):
    """Declared by keyword; notes when it steps and what it saw; `act(now_ns, inbox)` returns what it publishes."""

    def __init__(self, name, inputs=(), outputs=(), wakes=(), period_ns=0, act=None, lookahead_ns=0):
        self.name, self.inputs, self.outputs, self.wakes, self.period_ns = name, inputs, outputs, wakes, period_ns
        self.lookahead_ns = lookahead_ns
        self.act = act or (lambda now_ns, inbox: [])
        self.steps = []

    def step(self, now_ns, inbox):
        self.steps.append((now_ns, {topic: list(inbox.new(topic)) for topic in self.inputs if inbox.new(topic)}))
        return self.act(now_ns, inbox)


def publisher(name, topic, period_ns, delay_ns=0, lookahead_ns=0):
    """Publishes (its name, now) on `topic` each period."""
    return FakeNode(
        name, outputs=(topic,), period_ns=period_ns, act=lambda now_ns, _: [Out(topic, (name, now_ns), delay_ns)],
        lookahead_ns=lookahead_ns,
    )  # fmt: skip


def filled(node, *messages):
    """An inbox of `node` holding (topic, message) pairs, as if they had just arrived."""
    inbox = Inbox(node.inputs)
    for topic, message in messages:
        inbox.put(topic, message)
    return inbox
