"""The supervisor is gone when its process is, or when nothing comes from it any more."""

from hil.live.liveness import RECEIVED_WITHIN_NS, Presence, footprint


class World:
    def __init__(self):
        self.now_ns, self.parent = 1, 42

    def presence(self, **more):
        return Presence(clock=lambda: self.now_ns, parent=lambda: self.parent, **more)


def test_supervisor_is_alive_while_its_orders_arrive():
    world = World()
    presence = world.presence()
    for _ in range(10):
        presence.received()
        world.now_ns += RECEIVED_WITHIN_NS
        assert presence.gone() == ""


def test_missing_orders_are_reported_with_their_duration():
    world = World()
    presence = world.presence()
    presence.received()
    world.now_ns += RECEIVED_WITHIN_NS + 200_000_000
    assert presence.gone() == "nothing received from supervisor and hub for 3.2 s"
    presence.received()
    assert presence.gone() == ""


def test_supervisor_is_not_reported_missing_before_its_first_order():
    world = World()
    presence = world.presence()
    world.now_ns += 100 * RECEIVED_WITHIN_NS
    assert presence.gone() == ""


def test_dead_parent_process_is_reported_unless_the_service_is_remote():
    world = World()
    own, by_hand = world.presence(), world.presence(remote=True)
    world.parent = 1
    assert own.gone() == "the supervisor is gone"
    assert by_hand.gone() == ""


def test_footprint_reports_memory_and_cpu_time_of_the_process():
    found = footprint()
    assert found["rss_kb"] > 1000
    assert 1000 < found["own_kb"] < found["rss_kb"]
    assert found["cpu_s"] > 0
