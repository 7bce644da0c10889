"""The driver receives a recorded flight of a real PX4 v1.17: boot, take-off, OFFBOARD, failsafe, landing."""

import struct

import pytest

from tests.paths import PX4_DATA
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig

RECORDED = PX4_DATA / "session_downlink.bin"
MS = 1_000_000
BOOT_NS = 30_000 * MS  # our clock when the recording began; PX4 booted then


class Recording:
    """A wire that gives the recorded frames when they came: (ms since its beginning, frame), one after the other."""

    def __init__(self):
        self.now_ms, self._at, self._data = 0, 0, RECORDED.read_bytes()

    def send(self, data):
        pass

    def receive(self):
        items = []
        while self._at < len(self._data):
            (ms,) = struct.unpack_from("<I", self._data, self._at)
            if ms > self.now_ms:
                break
            end = self._at + 4 + self._data[self._at + 5] + 12
            items.append(self._data[self._at + 4 : end])
            self._at = end
        return items


@pytest.fixture(scope="module")
def flight():
    """Outputs of the driver at each step; the frames that it sends are discarded."""
    wire = Recording()
    link = Px4Link(wire, LinkConfig(start=(0.0, 0.0, 2.0, 0.0), fixed_offset_ns=-BOOT_NS))
    steps = []
    while wire.now_ms < 50_000:
        link.phase = "interrupted"  # only listens
        steps.append((wire.now_ms, link.step(BOOT_NS + wire.now_ms * MS)))
        wire.now_ms += 10
    return link, steps


def when(steps, condition):
    """Seconds at which `condition` (output) first held."""
    return next((ms / 1000 for ms, out in steps if condition(out)), None)


def test_every_recorded_frame_is_decoded(flight):
    link, _ = flight
    counters = link.counters
    assert (counters["garbage"], counters["unknown_frames"], counters["bad_odometry"]) == (0, 0, 0)


def test_recorded_modes_arming_and_failsafe_are_reported(flight):
    _, steps = flight
    assert when(steps, lambda out: out.armed) == pytest.approx(7.0, abs=0.1)
    assert when(steps, lambda out: out.mode == "AUTO.TAKEOFF") == pytest.approx(8.0, abs=0.1)
    assert when(steps, lambda out: out.connected and not out.landed) == pytest.approx(8.9, abs=0.1)
    assert when(steps, lambda out: out.mode == "OFFBOARD") == pytest.approx(19.1, abs=0.1)
    assert when(steps, lambda out: out.failsafe) == pytest.approx(30.2, abs=0.1)
    failing = [(ms, out) for ms, out in steps if out.failsafe]
    assert {out.mode for _, out in failing} == {"AUTO.RTL"}
    last = steps[-1][1]
    assert (last.armed, last.landed, last.mode) == (False, True, "OFFBOARD"), "what PX4 falls back to"


def test_texts_in_chunks_are_whole(flight):
    _, steps = flight
    texts = [note.text for _, out in steps for note in out.notes]
    for text in (
        "autopilot: Armed by external command",
        "autopilot: Using default takeoff altitude: 2.5 m",
        "autopilot: Failsafe activated",
        "autopilot: RTL: start return at 496 m (6 m above destination)",
        "autopilot: Disarmed by landing",
    ):
        assert texts.count(text) == 1, text


def test_recorded_odometry_is_in_the_world_frame_on_the_host_clock(flight):
    _, steps = flight
    samples = [(ms, sample) for ms, out in steps for sample in out.odometry]
    assert len(samples) > 80
    for ms, sample in samples:
        assert 0 <= BOOT_NS + ms * MS - sample.stamp_ns < 2_000 * MS  # its clock lagged behind by 1.2 % on the way
    top = max(sample.position[2] for _, sample in samples)
    assert 2.0 < top < 8.0, "height is up"
    climbing = [sample for ms, sample in samples if 10_500 < ms < 13_000]
    assert all(sample.velocity[2] > 0.1 for sample in climbing)
