"""A small client on a wire in memory, for the tests of the software Crazyflie."""

import struct

from hil.contract.wire import memory_pair
from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import Vertical
from vehicle.crazyflie.crtp import Info, Log, LogControl, Packet, Port, SupervisorCommand, pack, unpack
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000


class Rig:
    """One software Crazyflie, its client, and motion capture that feeds it (unless `blind`)."""

    def __init__(self, blind=False, **options):
        self.now, self.blind = 0, blind
        self.wire, device = memory_pair(lambda: self.now)
        self.sim = CrazyflieSim(device, load_airframe("crazyflie"), 1, **options)
        self.received = []
        self.sim.step(0)

    @property
    def flight(self):
        return self.sim.flight

    @property
    def state(self):
        return self.flight.supervisor.state

    def send(self, packet):
        self.wire.send(pack(packet))

    def run(self, ms, every=None, period_ms=20):
        """`ms` more milliseconds; `every` is called each period."""
        end = self.now + ms * MS
        while self.now < end:
            if every is not None and self.now // MS % period_ms == 0:
                every()
            if not self.blind and self.now // MS % 10 == 0:
                truth = self.sim.truth()
                self.send(commands.external_pose(truth.position, truth.orientation))
            self.now += 2 * MS
            self.sim.step(self.now)
            self.received += [unpack(data) for data in self.wire.receive()]

    def ask(self, packet, ms=4):
        """The answers on the packet's port and channel."""
        self.received.clear()
        self.send(packet)
        self.run(ms)
        return [p.data for p in self.received if (p.port, p.channel) == (packet.port, packet.channel)]

    def arm(self):
        self.run(200)
        self.send(commands.supervisor(SupervisorCommand.ARM, 1))
        self.run(200)

    def take_off(self, height=1.0):
        self.arm()
        self.send(commands.vertical(Vertical(False, height, None, 2.0)))
        self.run(3500)

    def bits(self):
        """Names of the supervisor's bits that are set."""
        return {bit.name for bit in Info if self.flight.info >> bit & 1}

    def texts(self):
        return b"".join(p.data for p in self.received if p.port == Port.CONSOLE).decode()

    def log(self, names, period_ms=10, block=1):
        """Create and start a block of float values."""
        numbers = self.sim._log.contents.numbers
        entries = b"".join(struct.pack("<BH", 7, numbers[name]) for name in names)
        self.send(Packet(Port.LOG, Log.CONTROL, bytes((LogControl.CREATE, block)) + entries))
        start = bytes((LogControl.START_MS, block)) + struct.pack("<H", period_ms)
        self.send(Packet(Port.LOG, Log.CONTROL, start))

    def data(self):
        """(time ms, values) of the log packets received."""
        rows = [p.data for p in self.received if (p.port, p.channel) == (Port.LOG, Log.DATA)]
        return [(int.from_bytes(d[1:4], "little"), struct.unpack(f"<{(len(d) - 4) // 4}f", d[4:])) for d in rows]
