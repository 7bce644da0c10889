"""A hub with keys: who has none, or of another authority, stays out; who is in hears and says what he may."""

import time

import pytest
import zenoh

from hil.assembly.node_table import SERVICES, service_nodes
from hil.assembly.rig import load_rig
from hil.bus.certificates import make_keys
from hil.bus.keys import access_control
from hil.bus.leaf import CONTROL, OBSERVERS, TOPIC, Bus, BusError, Mailbox, credentials_in, open_hub
from hil.bus.session import settings
from hil.contract import messages as m
from tests.unit.hil.bus.test_leaf import free_endpoint

ACTION = m.Action(1, True, (0.0, 0.0, 0.0), 9.81, "follow", 0, 9.81)
SENT = m.Sent(1, (0.0, 0.0, 0.0), 9.81, 0.3, False, "")
BOARD = m.BoardState(1, (0.0, 0.0, 1.5), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
LIMIT_S = 10.0


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

    def joined(who):
        buses.append(Bus(hub, credentials_in(keys, who)))
        return buses[-1]

    yield joined
    for bus in buses:
        bus.close()


class RunEvents:
    """Everything that is heard on a key: a subscription that nobody on this side has checked."""

    def __init__(self, bus, key):
        self.heard = []
        bus._listen(key, lambda sample: self.heard.append(str(sample.key_expr).removeprefix(TOPIC)))


def until(condition, again=lambda: None):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        again()
        time.sleep(0.02)


def test_a_process_without_a_certificate_is_refused(hub, keys):
    for more in (
        {},
        {"transport/link/tls/root_ca_certificate": str(keys / "ca.crt")},  # it trusts the hub, but is nobody itself
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


def test_a_client_notices_a_hub_of_another_authority(keys, tmp_path):
    make_keys(tmp_path / "other", ["hub"])
    endpoint = free_endpoint().replace("tcp/", "tls/")
    with (
        open_hub(endpoint, credentials_in(tmp_path / "other", "hub")),
        pytest.raises(BusError, match="another authority"),
    ):
        Bus(endpoint, credentials_in(keys, "brain"), timeout_s=1.5)


def test_the_policys_identity_receives_its_inputs_and_never_the_cars_truth(join):
    brain, car, detector = join("brain"), join("car_device"), join("detector")
    allowed, forbidden, all_of_it = (RunEvents(brain, TOPIC + key) for key in ("board/detection", "truth/board", "**"))
    witness = Mailbox()
    join("recorder").subscribe("recorder", ["truth/board"], witness)
    seen = m.Detection(1, False, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, (), (), "", 0, 0)

    def publish():
        car.publish(1, "truth/board", BOARD)
        detector.publish(1, "board/detection", seen)

    until(lambda: len(allowed.heard) >= 10 and len(witness.drain()) > 0, publish)
    assert forbidden.heard == []
    assert set(all_of_it.heard) <= {"board/detection"}
    witness.close()


def test_only_the_policy_commands_and_only_the_gate_publishes_what_was_sent(join):
    brain, link, camera, recorder = (join(who) for who in ("brain", "vehicle_link", "camera", "recorder"))
    mailbox, said = Mailbox(), {"policy/action": set(), "vehicle/sent": set()}
    recorder.subscribe("recorder", list(said), mailbox)

    def publish():
        for author, bus in enumerate((brain, link, camera)):
            bus.publish(author, "policy/action", ACTION)
            bus.publish(author, "vehicle/sent", SENT)
        for delivery in mailbox.drain():
            said[delivery.topic].add(delivery.published_ns)  # here: who wrote it

    until(lambda: all(said.values()), publish)
    for _ in range(20):
        publish()
        mailbox.wait(20_000_000)
    assert said == {"policy/action": {0}, "vehicle/sent": {1}}
    mailbox.close()


def test_only_the_supervisor_gives_orders(join):
    supervisor, brain, link = join("supervisor"), join("brain"), join("vehicle_link")
    orders = []
    link.on_table(CONTROL, orders.append)

    def both():
        brain.send_table(CONTROL, {"order": "abort", "why": "the policy says so"})
        supervisor.send_table(CONTROL, {"order": "watch"})

    until(lambda: len(orders) >= 10, both)
    assert all(order == {"order": "watch"} for order in orders)


def test_every_service_may_compare_clocks(join):
    assert join("camera").clock().measure(tries=3).shared
