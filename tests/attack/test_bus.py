"""The bus as an admitted identity may use it: forged messages, orders and healths, floods. None ends another service,
the recording or the run's supervisor."""

import json
import threading
import time

import pytest

from hil.assembly.node_table import SERVICES, service_nodes
from hil.assembly.rig import load_rig
from hil.bus.certificates import make_keys
from hil.bus.keys import access_control
from hil.bus.leaf import CONTROL, EVENT, HEALTH, OBSERVERS, TOPIC, Bus, Mailbox, credentials_in, open_hub
from hil.bus.mailbox import STAMP, Delivery
from hil.contract.codec import encode
from hil.contract.messages import Action, Belief
from hil.contract.node import Node, Out
from hil.contract.topics import TOPICS
from hil.live.graph import check_live_graph
from hil.live.messages.authors import attributed
from hil.live.messages.floods import Floods, flood_fault
from hil.live.messages.health import clean_health
from hil.live.messages.health_book import HealthBook
from hil.live.messages.orders import Orders
from hil.live.recorder import Sorter, _Seen
from hil.live.run_clock import RunTime, clock_fault, clock_lines
from hil.live.service import LiveService
from hil.recording.foxglove import FoxgloveView
from hil.recording.reader import Recording
from hil.recording.recorder import Recorder
from hil.safety.topic_liveness import liveness_fault
from tests.attack.forged import FACTOR, INTS, damaged, json_value, message, rng
from tests.unit.hil.bus.test_leaf import free_endpoint

LIMIT_S = 20.0
OWN = 0x0123456789ABCDEF


def until(condition, again=lambda: None):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        again()
        time.sleep(0.01)


@pytest.mark.parametrize("topic", TOPICS)
def test_mailbox_survives_any_payload_and_delivers_the_next_message(topic):
    random, mailbox = rng(topic), Mailbox(urgent=())
    kind = TOPICS[topic].message
    mailbox.put(topic, encode(message(kind, random)), STAMP.pack(1, 1, OWN), "brain")
    assert len(mailbox.drain()) == 1
    for number in range(2, 40 * FACTOR):
        whole = encode(message(kind, random))
        stamps = [STAMP.pack(t, n, s) for t, n, s in [(random.choice(INTS), abs(random.choice(INTS)) % 2**64, OWN)]]
        stamp = random.choice((*stamps, random.randbytes(24), random.randbytes(random.randrange(40)), b""))
        mailbox.wanted(topic, stamp)
        mailbox.put(topic, damaged(whole, random), stamp, random.choice(("brain", "", "x" * 1000)))
        for delivery in mailbox.drain():
            assert isinstance(delivery.message, kind)
            attributed(delivery)
        mailbox._expected.clear()  # as after a gap that is allowed
        mailbox.put(topic, encode(message(kind, random)), STAMP.pack(number, number, OWN), "brain")
        assert len(mailbox.drain()) == 1
    mailbox.close()


def test_recorder_survives_any_message(tmp_path):
    random, path, count = rng("recorder"), tmp_path / "run.mcap", 0
    sorter, seen = Sorter(), _Seen()
    with Recorder(path, view=FoxgloveView(pictures="all")) as recorder:
        for number in range(60 * FACTOR):
            for topic, row in TOPICS.items():
                forged = message(row.message, random)
                delivery = Delivery(topic, random.choice(INTS), number, forged, "brain")
                seen.note(delivery)
                sorter.add(attributed(delivery), number * 1_000_000)
            for now, delivery in sorter.take(number * 1_000_000):
                recorder(now, delivery.topic, delivery.message)
                count += 1
        for now, delivery in sorter.take(None):
            recorder(now, delivery.topic, delivery.message)
    json.dumps(seen.table(), allow_nan=False)
    recording = Recording(path)
    assert recording.complete
    stamps = [entry.log_ns for entry in recording.messages()]
    assert stamps == sorted(stamps)
    assert max(stamps) < 60 * FACTOR * 1_000_000 + 10_000_000  # no stamp of the future


HEALTHS = ("state", "why", "serves", "session", "host", "pid", "outputs", "nodes", "dropped", "lost", "garbage",
           "counters", "safe", "clock", "memory", "graph", "own_kb", "late", "strangers")  # fmt: skip


def test_supervisor_survives_any_health():
    random, book = rng("health"), HealthBook()
    services = [*SERVICES, *OBSERVERS]
    for _ in range(600 * FACTOR):
        keys = random.sample(HEALTHS, random.randrange(len(HEALTHS)))
        table = {key: json_value(random) for key in keys} | {"service": random.choice((*services, "x"))}
        table = json.loads(json.dumps(table))  # as it comes over the bus, NaN included
        book.note(table)
        clean = clean_health(table)
        json.dumps(clean, allow_nan=False)
        clock_fault("brain", clean.get("clock", {}))
        clock_lines("brain", clean.get("clock", {}))
    now = time.monotonic_ns()
    liveness_fault(now, book.health, dict.fromkeys(("belief", "run/stage"), now - 5 * 10**9), services)
    flood_fault({TOPIC + "belief": 10**6}, 1.0, book.health)
    book.double()
    assert set(book.health) <= set(services)
    check_live_graph(book.health, [])


def test_service_survives_any_order():
    random, orders = rng("order"), Orders("brain", "01")
    for _ in range(2000 * FACTOR):
        table = {key: json_value(random) for key in ("order", "epoch_ns", "service", "session", "why", "sessions")}
        if random.random() < 0.5:
            table["order"] = random.choice(("go", "abort", "stop", "watch"))
        orders.put(table)
        for order in orders.take():
            assert order["order"] in ("go", "abort", "stop")
            assert order["order"] != "go" or isinstance(order["epoch_ns"], int)
            orders.displaced(order)


class Brain(Node):
    """A node at 100 Hz that reads a topic of the attacker."""

    name, inputs, outputs, wakes, period_ns = "belief", ("board/detection",), ("belief",), ("board/detection",), 10**7

    def __init__(self):
        self.steps, self.received = 0, 0

    def step(self, now_ns, inbox):
        self.steps += 1
        self.received += len(inbox.new("board/detection"))
        place = (0.0, 0.0, 1.5)
        return [Out("belief", Belief(now_ns, True, place, 0.0, 1.0, 0.0, 0.5, 1.0, 0, 0, 0, (1.0,), 0.0, 1, 0.01))]


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("attack") / "keys"
    make_keys(folder, ["hub", *OBSERVERS, *SERVICES])
    return folder


@pytest.fixture(scope="module")
def hub(keys):
    endpoint = free_endpoint().replace("tcp/", "tls/")
    with open_hub(endpoint, credentials_in(keys, "hub"), access_control(service_nodes(load_rig("sim")))):
        yield endpoint


@pytest.fixture
def join(hub, keys):
    buses = []

    def joined(identity):
        buses.append(Bus(hub, credentials_in(keys, identity), identity=identity))
        return buses[-1]

    yield joined
    for bus in buses:
        bus.close()


@pytest.fixture
def brain(join):
    """A running service and its supervisor's bus."""
    bus, supervisor, node = join("brain"), join("supervisor"), Brain()
    live = LiveService("brain", [node], bus, RunTime(bus.clock()))
    thread = threading.Thread(target=lambda: live.wait_for_go() and live.run(), daemon=True)
    thread.start()
    ended = threading.Event()

    def beat():
        while not ended.wait(0.2):
            supervisor.send_table(CONTROL, {"order": "watch", "session": supervisor.session})

    until(lambda: node.steps, lambda: supervisor.send_table(CONTROL, go(supervisor)))
    beats = threading.Thread(target=beat, daemon=True)
    beats.start()
    yield node, supervisor
    ended.set()
    beats.join(LIMIT_S)
    live.stop()
    thread.join(LIMIT_S)
    assert not thread.is_alive()
    live.close()


def go(supervisor):
    return {"order": "go", "epoch_ns": time.monotonic_ns(), "session": supervisor.session}


def test_service_runs_on_under_forged_messages_and_tables(brain, join):
    """Whatever the detector's identity sends, on whatever key."""
    node, supervisor = brain
    random, attacker = rng("forged"), join("detector")
    orders, seen = [], []
    supervisor.on_table(CONTROL, orders.append)
    supervisor.on_table(HEALTH + "*", seen.append)
    keys = [TOPIC + topic for topic in TOPICS] + [EVENT + name for name in SERVICES] + [CONTROL]
    keys += [HEALTH + name for name in SERVICES]
    for _ in range(20 * FACTOR):
        for key in keys:
            topic = key.removeprefix(TOPIC)
            kind = TOPICS[topic].message if topic in TOPICS else Action
            payload = random.choice((
                random.randbytes(random.randrange(200)), damaged(encode(message(kind, random)), random),
                encode(message(kind, random)), json.dumps(json_value(random)).encode(),
                json.dumps({"order": "stop", "service": "brain"}).encode(), b"[" * 10_000,
            ))  # fmt: skip
            stamp = random.choice((STAMP.pack(random.choice(INTS), 2**63, OWN), STAMP.pack(1, 1, OWN), b"", b"x" * 24))
            attacker._session.put(key, payload, attachment=stamp)
        time.sleep(0.005)
    steps = node.steps
    until(lambda: node.steps > steps + 50)
    assert {order.get("session") for order in orders} <= {supervisor.session}
    assert {table["service"] for table in seen} <= {"brain", "detector"}


def test_flood_of_an_admitted_client_is_named_and_ends_no_other_service(brain, join):
    node, supervisor = brain
    attacker = join("mocap")
    floods = Floods(supervisor, {"mocap": {"outputs": ["mocap/board"]}, "brain": {"outputs": ["belief"]}})
    floods.count_all()
    forged = message(TOPICS["mocap/board"].message, rng("flood"))
    ends = time.monotonic() + 1.0
    while time.monotonic() < ends:
        for _ in range(100):
            attacker.publish(1, "mocap/board", forged)
        time.sleep(0.001)
    until(lambda: floods.fault())
    assert floods.fault().startswith("mocap floods mocap/board (")
    steps = node.steps
    until(lambda: node.steps > steps + 50)


def test_each_identity_reaches_only_its_own_keys(join):
    """Every identity on every topic, every event key and every health."""
    rig = load_rig("sim")
    table = access_control(service_nodes(rig))
    rules = {rule["id"]: set(rule["key_exprs"]) for rule in table["rules"]}
    recorder, heard = join("recorder"), set()
    for key in (TOPIC + "**", *(TOPIC + topic for topic in TOPICS), EVENT + "*", HEALTH + "*"):
        recorder._listen(key, lambda sample: heard.add((sample.payload.to_string(), str(sample.key_expr))))
    members = {name: join(name) for name in (*service_nodes(rig), "status", "supervisor")}
    targets = [TOPIC + topic for topic in TOPICS if topic != "event"]
    targets += [prefix + name for name in SERVICES for prefix in (EVENT, HEALTH)]

    def publish():
        for name, bus in members.items():
            for key in targets:
                bus._session.put(key, name)

    wanted = {(name, key) for name in members for key in targets if key in rules[f"{name}-in"]}
    until(lambda: wanted <= heard, publish)
    for _ in range(5):
        publish()
        time.sleep(0.02)
    assert {one for one in heard if one[0] in members} == wanted
