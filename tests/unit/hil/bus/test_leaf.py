"""The bus: messages come whole, in order, stamped; readers the contract does not list are refused; bad bytes count."""

import socket
import time
from types import SimpleNamespace

import pytest
import zenoh

from hil.bus.leaf import HEALTH, TOPIC, Bus, BusError, Mailbox, open_hub
from hil.bus.mailbox import STAMP
from hil.bus.session import no_shared_memory, settings
from hil.contract import messages as m
from hil.contract.codec import encode


def free_endpoint():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{one.getsockname()[1]}"


@pytest.fixture
def endpoint():
    where = free_endpoint()
    with open_hub(where):
        yield where


def belief(number):
    place = (float(number), 0.0, 1.5)
    return m.Belief(number, True, place, 0.0, 1.0, 0.0, 0.5, 1.0, number, 1, 0, (1.0, 2.0), 0.0, 1, 0.01)


def image(number):
    return m.Image(number, 640, 480, 1, bytes([number]) * (640 * 480), number)


def collect(mailbox, count, limit_s=5.0):
    deliveries, until = [], time.monotonic() + limit_s
    while len(deliveries) < count and time.monotonic() < until:
        mailbox.wait(50_000_000)
        deliveries += mailbox.drain()
    return deliveries


def published_until_received(bus, mailbox, topic, make):
    """Publish until the subscription, which takes a moment to reach the hub, lets one through.

    Returns (how many were published, what came of them). While sessions are new and the machine is busy some may be
    lost, the last one too.
    """
    for number in range(200):
        bus.publish(number, topic, make(number))
        mailbox.wait(20_000_000)
        deliveries = mailbox.drain()
        if deliveries:
            while deliveries[-1].sequence < number and (more := collect(mailbox, 1, 1.0)):
                deliveries += more
            return number + 1, deliveries
    raise AssertionError("no message was received")


def test_messages_arrive_complete_in_order_and_stamped(endpoint):
    mailbox = Mailbox()
    with Bus(endpoint) as a, Bus(endpoint) as b:
        b.subscribe("policy", ["belief"], mailbox)
        first, _ = published_until_received(a, mailbox, "belief", belief)
        for number in range(first, first + 200):
            assert a.publish(1000 + number, "belief", belief(number)) == number
        deliveries = collect(mailbox, 200)
        assert [delivery.sequence for delivery in deliveries] == list(range(first, first + 200))
        assert all(delivery.message == belief(delivery.sequence) for delivery in deliveries)
        assert all(delivery.published_ns == 1000 + delivery.sequence for delivery in deliveries)
        assert (mailbox.dropped, mailbox.lost, mailbox.garbage) == ({}, {}, 0)
    mailbox.close()


def test_pictures_arrive_bit_for_bit(endpoint):
    mailbox = Mailbox(pictures=60)
    with Bus(endpoint) as a, Bus(endpoint) as b:
        b.subscribe("detector", ["camera/image"], mailbox)
        first, deliveries = published_until_received(a, mailbox, "camera/image", image)
        for number in range(first, first + 20):  # the sessions are no longer new
            a.publish(number, "camera/image", image(number))
            deliveries += collect(mailbox, 1, 0.1)
        assert deliveries[-1].sequence > first
        assert [delivery.message for delivery in deliveries] == [image(delivery.sequence) for delivery in deliveries]
    mailbox.close()


@pytest.mark.parametrize(
    ("reader", "topic", "text"),
    [
        ("policy", "truth/board", "policy may not read 'truth/board': the contract allows vehicle_device, camera"),
        ("belief", "mocap/board", "may not read"),
        ("policy", "truth/bord", "does not list"),
    ],
)
def test_subscription_outside_the_contract_is_refused(endpoint, reader, topic, text):
    with Bus(endpoint) as bus, pytest.raises(BusError, match=text):
        bus.subscribe(reader, [topic], Mailbox())


def test_recorder_may_subscribe_to_every_topic(endpoint):
    with Bus(endpoint) as bus:
        bus.subscribe("recorder", ["truth/board", "belief"], Mailbox())


def test_readers_that_share_a_mailbox_get_each_message_once(endpoint):
    mailbox = Mailbox()
    with Bus(endpoint) as a, Bus(endpoint) as b:
        b.subscribe("belief", ["vehicle/odometry"], mailbox)
        b.subscribe("policy", ["vehicle/odometry", "belief"], mailbox)
        with pytest.raises(BusError, match="may not read"):
            b.subscribe("referee", ["vehicle/odometry"], mailbox)
        level = (1.0, 0.0, 0.0, 0.0)
        first, _ = published_until_received(
            a, mailbox, "vehicle/odometry", lambda n: m.VehicleState(n, (0.0,) * 3, (0.0,) * 3, level, (0.0,) * 3)
        )
        for number in range(20):
            a.publish(number, "vehicle/odometry", m.VehicleState(number, (0.0,) * 3, (0.0,) * 3, level, (0.0,) * 3))
        assert a.publish(0, "belief", belief(0)) == 0
        deliveries = []
        while not deliveries or deliveries[-1].topic != "belief":  # nothing of before comes after it
            deliveries += collect(mailbox, 1)
        assert [one.sequence for one in deliveries if one.topic == "vehicle/odometry"] == list(range(first, first + 20))
    mailbox.close()


def test_invalid_payload_is_counted_and_not_delivered(endpoint):
    mailbox = Mailbox()
    with Bus(endpoint) as a, Bus(endpoint) as b:
        b.subscribe("policy", ["belief"], mailbox)
        published_until_received(a, mailbox, "belief", belief)
        stamp = STAMP.pack(0, 0, a._number)
        for payload, attachment in ((b"\xff\xff", stamp), (encode(belief(1)), b"short"), (encode(belief(1)), None)):
            a._session.put(TOPIC + "belief", payload, attachment=attachment)
        until = time.monotonic() + 5.0
        while mailbox.garbage < 3 and time.monotonic() < until:
            mailbox.wait(20_000_000)
            assert mailbox.drain() == []
        assert mailbox.garbage == 3
    mailbox.close()


def test_health_table_belongs_to_the_service_of_its_key(endpoint):
    received = []
    with Bus(endpoint) as a, Bus(endpoint) as b:
        b.on_table(HEALTH + "*", received.append)
        until = time.monotonic() + 5.0
        while not received and time.monotonic() < until:
            a._session.put(HEALTH + "x", b"no json")
            a._session.put(HEALTH + "x", b"[1]")
            a.send_table(HEALTH + "x", {"service": "vehicle_link", "safe": True})
            time.sleep(0.02)
    assert received
    assert all(table == {"service": "x", "safe": True} for table in received), (
        "the key names the service, not the table"
    )


def test_hub_on_the_same_machine_shares_the_clock(endpoint):
    with Bus(endpoint) as bus:
        clock = bus.clock().measure()
    assert clock.shared
    assert clock.offset_ns == 0


def test_clock_offset_of_another_machine_is_measured(endpoint, monkeypatch):
    monkeypatch.setattr("hil.bus.clock.clock_id", lambda: b"another machine")
    with Bus(endpoint) as bus:
        watch = bus.clock()
        first = watch.measure(tries=5)
        assert not first.shared
        assert first.error_ns > 0
        assert abs(first.offset_ns) <= first.error_ns  # the same clock in truth
        assert abs(first.date_ns) <= first.error_ns + 1_000_000
        watch.ask()
        assert watch.best is not None
        assert abs(watch.moved_ns) <= 2 * first.error_ns


def test_missing_hub_error_names_the_command_to_start():
    with pytest.raises(BusError, match="perch-hil bus hub"):
        Bus(free_endpoint(), timeout_s=0.3)


def test_hub_port_in_use_error_names_the_endpoint(endpoint):
    with pytest.raises(BusError, match=f"cannot listen on {endpoint}: another hub or program is on that port"):
        open_hub(endpoint)


def test_hub_address_of_another_host_error_names_it():
    with pytest.raises(BusError, match="this host has no such address"):
        open_hub("tcp/192.0.2.1:7447")


# the mailbox by itself


def put(mailbox, topic, number, message):
    stamp = STAMP.pack(number, number, 7)
    if mailbox.wanted(topic, stamp):
        mailbox.put(topic, encode(message), stamp)


def test_mailbox_keeps_the_newest_picture_and_counts_the_others():
    mailbox = Mailbox()
    for number in range(5):
        put(mailbox, "camera/image", number, image(number))
    assert [delivery.sequence for delivery in mailbox.drain()] == [4]
    assert mailbox.dropped == {"camera/image": 4}


def test_a_reader_with_a_picture_period_takes_fewer_pictures_and_counts_none_as_lost():
    mailbox = Mailbox(pictures=60, picture_period_ns=50)
    for at_ns in (0, 17, 33, 52, 67, 83, 100, 117):  # published at; the number beside it is the same
        put(mailbox, "camera/image", at_ns, image(1))
        put(mailbox, "belief", at_ns, belief(1))
    deliveries = mailbox.drain()
    assert [one.published_ns for one in deliveries if one.topic == "camera/image"] == [0, 52, 117]
    assert len(deliveries) == 8 + 3
    assert "camera/image" not in mailbox.lost | mailbox.dropped


def test_full_mailbox_drops_its_oldest_message():
    mailbox = Mailbox(depth=8)
    for number in range(11):
        put(mailbox, "belief", number, belief(number))
    assert [delivery.sequence for delivery in mailbox.drain()] == list(range(3, 11))
    assert mailbox.dropped == {"belief": 3}


def test_missing_sequence_numbers_are_counted():
    mailbox = Mailbox()
    for number in (0, 1, 4, 5, 9):
        put(mailbox, "belief", number, belief(number))
    mailbox.drain()
    assert mailbox.lost == {"belief": 5}


@pytest.mark.parametrize("wild", [2**63, 2**64 - 1, 2**32, 70_000])
def test_invalid_sequence_number_is_counted_and_the_next_message_is_delivered(wild):
    mailbox = Mailbox()
    for number in (0, wild, 1):
        mailbox.put("belief", encode(belief(number % 1000)), STAMP.pack(0, number, 7))
    assert [delivery.sequence for delivery in mailbox.drain()] == [0, 1]
    assert (mailbox.garbage, mailbox.lost) == (1, {})


def test_mailbox_takes_a_topic_from_its_first_publisher_only():
    mailbox = Mailbox()
    for session, number in ((7, 0), (8, 100), (7, 1), (8, 101)):
        mailbox.put("belief", encode(belief(number)), STAMP.pack(0, number, session))
    assert [delivery.sequence for delivery in mailbox.drain()] == [0, 1]
    assert (mailbox.strangers, mailbox.lost) == ({"belief": 2}, {})
    mailbox.forget()  # the run starts
    mailbox.put("belief", encode(belief(5)), STAMP.pack(0, 5, 8))
    assert [delivery.sequence for delivery in mailbox.drain()] == [5]


def test_events_of_all_publishers_are_delivered_with_their_authors(endpoint):
    mailbox, authors = Mailbox(), set()
    event = m.Event(1, "info", "director", "text")
    with Bus(endpoint, identity="brain") as a, Bus(endpoint, identity="camera") as b, Bus(endpoint) as reader:
        reader.subscribe("recorder", ["event"], mailbox)
        until = time.monotonic() + 5.0
        while authors != {"brain", "camera"} and time.monotonic() < until:
            a.publish(1, "event", event)
            b.publish(1, "event", event)
            mailbox.wait(20_000_000)
            authors |= {delivery.author for delivery in mailbox.drain()}
    assert authors == {"brain", "camera"}
    mailbox.close()


def test_pictures_arrive_through_the_sockets_where_shared_memory_is_too_small(monkeypatch):
    monkeypatch.setattr("hil.bus.session.os.statvfs", lambda _: SimpleNamespace(f_bavail=16384, f_frsize=4096))
    assert settings(mode="client").get_json("transport/shared_memory/enabled") == "false"
    mailbox, where = Mailbox(pictures=60), free_endpoint()
    with open_hub(where), Bus(where) as a, Bus(where) as b:
        b.subscribe("detector", ["camera/image"], mailbox)
        first, deliveries = published_until_received(a, mailbox, "camera/image", image)
        for number in range(first, first + 20):
            a.publish(number, "camera/image", image(number))
            deliveries += collect(mailbox, 1, 0.1)
    assert len(deliveries) >= 15
    assert [delivery.message for delivery in deliveries] == [image(delivery.sequence) for delivery in deliveries]
    mailbox.close()


def test_too_small_shared_memory_is_told_with_the_remedy(tmp_path, monkeypatch):
    assert no_shared_memory(tmp_path / "none").endswith("No such file or directory")
    monkeypatch.setattr("hil.bus.session.os.statvfs", lambda _: SimpleNamespace(f_bavail=16384, f_frsize=4096))
    assert "has 64 MB free and shared memory needs 256 MB (of a container: --shm-size=512m)" in no_shared_memory()


def test_mailbox_keeps_the_order_between_topics():
    mailbox = Mailbox()
    order = ["belief", "run/stage", "belief", "run/stage"]
    for number, topic in enumerate(order):
        put(mailbox, topic, number // 2, belief(number) if topic == "belief" else m.Stage(number, "lead", 0, 0))
    assert [delivery.topic for delivery in mailbox.drain()] == order


def test_zenoh_multicast_scouting_is_off():
    config = settings(mode="client")
    assert isinstance(config, zenoh.Config)
    assert config.get_json("scouting/multicast/enabled") == "false"
    assert config.get_json("scouting/gossip/enabled") == "false"
