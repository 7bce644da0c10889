"""A hub with keys refuses a client without a valid certificate, and each client topics that are not its own."""

import time

import pytest
import zenoh

from hil.assembly.node_table import SERVICES, service_nodes
from hil.assembly.rig import load_rig
from hil.bus.certificates import make_keys
from hil.bus.keys import access_control
from hil.bus.leaf import CONTROL, HEALTH, OBSERVERS, TOPIC, Bus, BusError, Mailbox, credentials_in, open_hub
from hil.bus.session import settings
from hil.contract import messages as m
from tests.unit.hil.bus.test_leaf import free_endpoint

ACTION = m.Action(1, True, (0.0, 0.0, 0.0), 9.81, "follow", 0, 9.81)
SENT = m.Sent(1, (0.0, 0.0, 0.0), 9.81, 0.3, False, "")
BOARD = m.BoardState(1, (0.0, 0.0, 1.5), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
LIMIT_S = 30.0


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("closed") / "keys"
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


class RunEvents:
    """Everything received on a key: a subscription without a check on the side of the client."""

    def __init__(self, bus, key):
        self.received = []
        bus._listen(key, lambda sample: self.received.append(str(sample.key_expr).removeprefix(TOPIC)))


def until(condition, again=lambda: None):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        again()
        time.sleep(0.02)


def test_a_process_without_a_certificate_is_refused(hub, keys):
    for more in (
        {},
        {"transport/link/tls/root_ca_certificate": str(keys / "ca.crt")},  # it trusts the hub, but has no certificate
    ):
        config = settings(mode="client", **{"connect/endpoints": [hub], "connect/timeout_ms": 1500}, **more)
        with pytest.raises(zenoh.ZError):
            zenoh.open(config).close()
    with pytest.raises(BusError, match="lets no process in without --keys"):
        Bus(hub, timeout_s=1.0)
    with pytest.raises(BusError, match="no hub answers"):
        Bus(hub.replace("tls/", "tcp/"), timeout_s=1.0)


def test_a_certificate_of_another_authority_is_refused(hub, keys, tmp_path):
    make_keys(tmp_path / "other", ["brain"])
    foreign = credentials_in(tmp_path / "other", "brain")
    with pytest.raises(BusError, match="another authority"):
        Bus(hub, foreign, timeout_s=1.5)
    with pytest.raises(BusError, match="another authority"):  # even if it takes the hub for what it is
        Bus(hub, foreign._replace(authority=keys / "ca.crt"), timeout_s=1.5)


def test_client_refuses_a_hub_of_another_authority(keys, tmp_path):
    make_keys(tmp_path / "other", ["hub"])
    endpoint = free_endpoint().replace("tcp/", "tls/")
    with (
        open_hub(endpoint, credentials_in(tmp_path / "other", "hub")),
        pytest.raises(BusError, match="another authority"),
    ):
        Bus(endpoint, credentials_in(keys, "brain"), timeout_s=1.5)


def test_policy_identity_receives_its_inputs_and_no_truth_of_the_car(join):
    brain, car, detector = join("brain"), join("car_device"), join("detector")
    allowed, forbidden, all_of_it = (RunEvents(brain, TOPIC + key) for key in ("board/detection", "truth/board", "**"))
    witness = Mailbox()
    join("recorder").subscribe("recorder", ["truth/board"], witness)
    seen = m.Detection(1, False, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, (), (), "", 0, 0)

    def publish():
        car.publish(1, "truth/board", BOARD)
        detector.publish(1, "board/detection", seen)

    until(lambda: len(allowed.received) >= 10 and len(witness.drain()) > 0, publish)
    assert forbidden.received == []
    assert set(all_of_it.received) <= {"board/detection"}
    witness.close()


def test_hub_accepts_commands_only_from_policy_and_sent_only_from_gate(join):
    brain, link, camera, recorder = (join(identity) for identity in ("brain", "vehicle_link", "camera", "recorder"))
    mailbox, writers = Mailbox(), {"policy/action": set(), "vehicle/sent": set()}
    recorder.subscribe("recorder", list(writers), mailbox)

    def publish():
        for author, bus in enumerate((brain, link, camera)):
            bus.publish(author, "policy/action", ACTION)
            bus.publish(author, "vehicle/sent", SENT)
        for delivery in mailbox.drain():
            writers[delivery.topic].add(delivery.published_ns)  # in this test the stamp identifies the writer

    until(lambda: all(writers.values()), publish)
    for _ in range(20):
        publish()
        mailbox.wait(20_000_000)
    assert writers == {"policy/action": {0}, "vehicle/sent": {1}}
    mailbox.close()


def test_orders_are_accepted_only_from_the_supervisor(join):
    supervisor, brain, link = join("supervisor"), join("brain"), join("vehicle_link")
    orders = []
    link.on_table(CONTROL, orders.append)

    def both():
        brain.send_table(CONTROL, {"order": "abort", "why": "the policy says so"})
        supervisor.send_table(CONTROL, {"order": "watch"})

    until(lambda: len(orders) >= 10, both)
    assert all(order == {"order": "watch"} for order in orders)


def test_identity_cannot_publish_an_event_as_another(hub, keys, join):
    recorder, mailbox, texts = join("recorder"), Mailbox(), set()
    recorder.subscribe("recorder", ["event"], mailbox)
    with Bus(hub, credentials_in(keys, "brain"), identity="referee") as forged:

        def publish():
            forged.publish(1, "event", m.Event(1, "error", "director", "forged"))
            join_brain.publish(1, "event", m.Event(1, "info", "policy", "own"))
            texts.update((delivery.author, delivery.message.text) for delivery in mailbox.drain())

        join_brain = join("brain")
        until(lambda: texts, publish)
        for _ in range(20):
            publish()
            mailbox.wait(20_000_000)
    assert texts == {("brain", "own")}
    mailbox.close()


def test_viewer_reads_every_topic_and_publishes_nothing(join):
    viewer, car, recorder = join("viewer"), join("car_device"), join("recorder")
    shown, witness, orders = RunEvents(viewer, TOPIC + "truth/board"), Mailbox(), []
    recorder.subscribe("recorder", ["truth/board", "policy/action", "event"], witness)
    recorder.on_table(CONTROL, orders.append)
    recorder.on_table(HEALTH + "*", orders.append)
    authors = set()

    def publish():
        car.publish(1, "truth/board", BOARD)
        viewer.publish(2, "truth/board", BOARD)
        viewer.publish(2, "policy/action", ACTION)
        viewer.publish(2, "event", m.Event(2, "error", "viewer", "forged"))
        viewer.send_table(CONTROL, {"order": "abort"})
        viewer.send_table(HEALTH + "viewer", {"state": "ready"})
        authors.update((delivery.topic, delivery.published_ns) for delivery in witness.drain())

    until(lambda: len(shown.received) >= 10 and authors, publish)
    for _ in range(20):
        publish()
        witness.wait(20_000_000)
    assert authors == {("truth/board", 1)} and orders == []
    witness.close()


def test_every_service_identity_may_compare_clocks(join):
    assert join("camera").clock().measure(tries=3).shared
