"""The supervisor is gone when its process is, or when nothing comes from it any more."""

from hil.live.liveness import SILENT_NS, Presence, footprint


class World:
    def __init__(self):
        self.now_ns, self.parent = 1, 42

    def presence(self, **more):
        return Presence(clock=lambda: self.now_ns, parent=lambda: self.parent, **more)


def test_a_supervisor_that_speaks_is_there():
    world = World()
    presence = world.presence()
    for _ in range(10):
        presence.heard()
        world.now_ns += SILENT_NS
        assert presence.gone() == ""


def test_silence_says_for_how_long():
    world = World()
    presence = world.presence()
    presence.heard()
    world.now_ns += SILENT_NS + 200_000_000
    assert presence.gone() == "supervisor and hub are silent for 3.2 s"
    presence.heard()
    assert presence.gone() == ""


def test_who_never_spoke_is_not_missed():
    world = World()
    presence = world.presence()
    world.now_ns += 100 * SILENT_NS
    assert presence.gone() == ""


def test_a_dead_parent_counts_unless_it_was_nobody():
    world = World()
    own, by_hand = world.presence(), world.presence(remote=True)
    world.parent = 1
    assert own.gone() == "the supervisor is gone"
    assert by_hand.gone() == ""


def test_a_process_knows_what_it_takes():
    found = footprint()
    assert found["rss_kb"] > 1000
    assert 1000 < found["own_kb"] < found["rss_kb"]
    assert found["cpu_s"] > 0
