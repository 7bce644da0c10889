"""The driver and the software PX4 at both ends of a wire in memory, for the tests of the driver."""

import math
from dataclasses import replace

from hil.contract.wire import memory_pair
from vehicle.px4.codec import MESSAGES, Packer
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
HERE = (3.0, -2.0, 0.0)
START = (3.5, -2.5, 3.0, 0.9)
HEADING = 0.7
HOVER = Rates((0.0, 0.0, 0.0), 9.80665)
NAN = float("nan")


def hover(_):
    return HOVER


def client(system=255, component=190):
    """Frames of another system on the wire."""
    return Packer(system, component)


class Tap:
    """Our end of the wire: stores sent frames, drops them while `stopped`, and can insert frames of other systems."""

    def __init__(self, wire):
        self._wire, self.sent, self.stopped, self.noise = wire, [], False, []

    def send(self, data):
        self.sent.append(data)
        if not self.stopped:
            self._wire.send(data)

    def receive(self):
        items, self.noise = self._wire.receive() + self.noise, []
        return items

    def close(self):
        self._wire.close()


class Bench:
    """PX4 in ticks of 4 ms, the driver every 2 ms, commands every 10 ms. `now` (ns) starts at some odd time."""

    def __init__(self, frame="paper_quad", seed=1, delay_ms=1.0, begin_ns=7_000_000_000, sim=None, gcs=False, **config):
        self.now = self.begin = begin_ns
        airframe = load_airframe(frame)
        ours, self.theirs = memory_pair(lambda: self.now, round(delay_ms * MS))
        self.tap = Tap(ours)
        links = {"api": self.theirs}
        if gcs:
            self.gcs, links["gcs"] = memory_pair(lambda: self.now)
        options = {"position": HERE, "yaw": HEADING} | (sim or {})
        self.sim = Px4Sim(links, airframe, seed, **options)
        self.config = LinkConfig(**({"start": START, "hover_thrust": airframe.hover_thrust} | config))
        self.link = Px4Link(self.tap, self.config)
        self.out = None
        self.phases, self.notes, self.odometry, self.sent = [], [], [], []
        self.truth = {}  # our time: truth
        self.each = lambda: None
        self.pose = lambda: None

    def relink(self, **config):
        """The driver's process was started again."""
        self.link = Px4Link(self.tap, replace(self.config, **config))
        return self

    def stop_reception(self, stopped):
        """PX4 stops receiving our frames, or receives them again."""
        self.tap.stopped = stopped

    @property
    def uplink(self):
        """What went out, one item a frame."""
        return self.tap.sent

    @property
    def asked(self):
        """Names of the messages in `uplink`."""
        return {MESSAGES.get(frame[7] | frame[8] << 8).name for frame in self.uplink}

    @property
    def seconds(self):
        return (self.now - self.begin) * 1e-9

    @property
    def texts(self):
        return [note.text for _, note in self.notes]

    def reported(self, part):
        return [text for text in self.texts if part in text]

    def run(self, seconds, command=None, until=None):
        """`command` (now_ns) -> Rates or None every 10 ms; stops early when `until` () holds; True if it did."""
        end = self.now + round(seconds * 1e9)
        while self.now < end:
            if until is not None and until():
                return True
            if (self.now - self.begin) % (4 * MS) == 0:
                self.sim.step(self.now)
                self.truth[self.now] = self.sim.truth()
            due = command is not None and (self.now - self.begin) % (10 * MS) == 0
            self.each()
            self.step(command(self.now) if due else None)
            self.now += 2 * MS
        return until is not None and until()

    def step(self, command=None):
        out = self.out = self.link.step(self.now, command, self.pose())
        self.notes += [(self.seconds, note) for note in out.notes]
        self.odometry += [(self.now, sample) for sample in out.odometry]
        if out.sent_thrust is not None:
            self.sent.append((self.now, command, out.sent_thrust))
        if not self.phases or self.phases[-1][1] != out.phase:
            self.phases.append((self.seconds, out.phase))

    def to(self, phase, limit=40.0):
        """Run until that phase; fails the test with the notes if it is not reached."""
        assert self.run(limit, until=lambda: self.link.phase == phase), (phase, self.phases, self.texts[-6:])
        return self

    @property
    def speed(self):
        return math.hypot(*self.sim.truth().velocity)
