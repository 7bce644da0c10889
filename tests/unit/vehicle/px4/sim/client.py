"""A small ground station on a wire in memory, for the tests of the software PX4."""

import math

from hil.contract.wire import memory_pair
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.protocol import POSITION_YAW
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

NAN = math.nan
READY_MS = 5200


class Rig:
    """One software PX4 and a client on its API link (and on its GCS link if asked for)."""

    def __init__(self, ready=True, gcs=False, frame="sih_quad", seed=1, **options):
        self.now = 0
        self.wire, device = memory_pair(lambda: self.now)
        links = {"api": device}
        if gcs:
            self.gcs_wire, links["gcs"] = memory_pair(lambda: self.now)
            self.gcs_parser = Parser()
        self.gcs_log = []
        self.sim = Px4Sim(links, load_airframe(frame), seed, **options)
        self.packer, self.parser, self.log = Packer(245, 190), Parser(), []
        self.sim.step(0)
        if ready:
            self.run(READY_MS)
            self.log.clear()

    @property
    def ms(self):
        return self.now // 1_000_000

    @property
    def flight(self):
        return self.sim.flight

    def send(self, name, *values):
        self.wire.send(self.packer.send_name(name, *values))

    def command(self, number, *params, system=1, component=1):
        self.send("COMMAND_LONG", system, component, number, 0, *params, *(0.0,) * (7 - len(params)))

    def run(self, ms, every=None, period_ms=20):
        """`ms` more milliseconds; `every` is called each period."""
        end = self.now + ms * 1_000_000
        while self.now < end:
            if every is not None and self.ms % period_ms == 0:
                every()
            self.now += 4_000_000
            self.sim.step(self.now)
            for data in self.wire.receive():
                self.log.extend((self.ms, frame) for frame in self.parser.feed(data))
            if hasattr(self, "gcs_wire"):
                for data in self.gcs_wire.receive():
                    self.gcs_log.extend((self.ms, frame) for frame in self.gcs_parser.feed(data))

    def of(self, name):
        """Fields of every message of that name received so far from PX4."""
        return [frame.fields for _, frame in self.log if frame.name == name and frame.system == 1]

    def texts(self):
        return [m.text for m in self.of("STATUSTEXT")]

    def answers(self, number=None):
        return [m.result for m in self.of("COMMAND_ACK") if number in (None, m.command)]

    def ask(self, number, *params, ms=24, **to):
        """Send a command; the results of the answers to it."""
        before = len(self.answers())
        self.command(number, *params, **to)
        self.run(ms)
        return self.answers()[before:]

    def rates(self, roll=0.0, pitch=0.0, yaw=0.0, thrust=0.0, mask=0x80, system=1, component=1, q=(1.0, 0.0, 0.0, 0.0)):
        self.send("SET_ATTITUDE_TARGET", self.ms, system, component, mask, q, roll, pitch, yaw, thrust)

    def goto(self, north, east, down, yaw=0.0, mask=int(POSITION_YAW)):
        self.send("SET_POSITION_TARGET_LOCAL_NED", self.ms, 1, 1, 1, mask, north, east, down, *(0.0,) * 6, yaw, 0.0)

    def mode(self, main, sub=0):
        return self.ask(176, 1.0, float(main), float(sub))

    def fly_to_hover(self):
        """Take off in Hold to 2.5 m; ends in Hold with an empty log."""
        assert self.ask(400, 1.0) == [0]
        self.run(1000)
        assert self.ask(22, NAN, 0.0, 0.0, NAN, NAN, NAN, NAN) == [0]
        self.run(9000)
        assert not self.flight.landed and self.flight.position[2] > 2.2
        self.log.clear()
        return self
