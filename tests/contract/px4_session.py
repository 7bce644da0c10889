"""A flight as it was recorded on a real PX4, flown again on the software PX4 at the recorded PX4 times."""

import json
import math

from hil.contract.wire import memory_pair
from tests.paths import PX4_DATA
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.px4.sim.estimator import GPS_NOISE
from vehicle.quadrotor.airframe import load_airframe

FACTS = json.loads((PX4_DATA / "session_facts.json").read_text())
TICK_NS = 4_000_000
NAN = math.nan
# Body rate pulses of the recorded flight: from, to (ms), axis, rad/s; level in between.
PULSES = [
    (20904, 21204, 0, 1.0), (21204, 21812, 0, -1.0), (21812, 22124, 0, 1.0),
    (23424, 23724, 1, 1.0), (23724, 24324, 1, -1.0), (24324, 24632, 1, 1.0),
    (25944, 27444, 2, 0.8),
]  # fmt: skip


class Client:
    """One ground station: sends by name, keeps every frame with its PX4 time (ms)."""

    def __init__(self, wire, system=245, component=190):
        self.wire, self.packer, self.parser = wire, Packer(system, component), Parser()
        self.log = []

    def send(self, name, *values):
        self.wire.send(self.packer.send_name(name, *values))

    def command(self, number, *params):
        self.send("COMMAND_LONG", 1, 1, number, 0, *params, *(0.0,) * (7 - len(params)))

    def listen(self, ms):
        for data in self.wire.receive():
            self.log.extend((ms, frame) for frame in self.parser.feed(data))

    def of(self, name):
        return [(ms, frame.fields) for ms, frame in self.log if frame.name == name and frame.system == 1]

    def changes(self, name, *fields):
        """(ms, values) whenever the named fields differ from the message before."""
        out = []
        for ms, message in self.of(name):
            values = [getattr(message, field) for field in fields]
            if not out or out[-1][1:] != values:
                out.append([ms, *values])
        return out


class Session:
    """Two clients on two links of one software PX4."""

    def __init__(self, seed=1, noise=GPS_NOISE, **options):
        self.now = 0
        api, api_device = memory_pair(lambda: self.now)
        gcs, gcs_device = memory_pair(lambda: self.now)
        self.api, self.gcs = Client(api), Client(gcs, 255)
        frame = load_airframe("sih_quad")
        self.sim = Px4Sim({"api": api_device, "gcs": gcs_device}, frame, seed, noise=noise, **options)
        self.sim.step(0)

    @property
    def ms(self):
        return self.now // 1_000_000

    def run_until(self, ms, every=None, period_ms=20):
        while self.ms < ms:
            if every is not None and self.ms % period_ms == 0:
                every()
            if self.ms % 1000 == 0:
                for client in (self.api, self.gcs):
                    client.send("HEARTBEAT", 6, 8, 0, 0, 4, 3)
            self.now += TICK_NS
            self.sim.step(self.now)
            self.api.listen(self.ms)
            self.gcs.listen(self.ms)

    def rates(self, roll=0.0, pitch=0.0, yaw=0.0, thrust=0.4903):
        self.api.send("SET_ATTITUDE_TARGET", self.ms, 1, 1, 0x80, (1.0, 0.0, 0.0, 0.0), roll, pitch, yaw, thrust)

    def hold_level(self):
        """The recorded pilot: pulses, and between them level at a slow climb, from the telemetry alone."""
        attitude = self.api.of("ATTITUDE")[-1][1]
        position = self.api.of("LOCAL_POSITION_NED")[-1][1]
        rates = [-4.0 * attitude.roll, -4.0 * attitude.pitch, 0.0]
        for start, end, axis, rate in PULSES:
            if start <= self.ms < end:
                rates[axis] = rate
                if axis < 2:
                    rates[1 - axis] = 0.0
        climb = 0.5 if position.z > -5.7 else 0.0
        thrust = 0.4903 + 0.10 * (climb + position.vz) / max(0.6, math.cos(attitude.roll) * math.cos(attitude.pitch))
        self.rates(rates[0], rates[1], rates[2], min(0.7, max(0.3, thrust)))


def fly():
    """The whole recorded sequence."""
    at = FACTS["schedule_ms"]
    session = Session()
    session.run_until(at["arm"])
    session.api.command(400, 1.0)
    session.run_until(at["takeoff"])
    session.api.command(22, NAN, 0.0, 0.0, NAN, NAN, NAN, NAN)
    session.run_until(at["setpoints"])
    session.run_until(at["offboard"], session.hold_level)
    session.api.command(176, 1.0, 6.0)
    session.run_until(at["stop"], session.hold_level)
    session.run_until(at["land"])
    session.api.command(21, 0.0, 0.0, 0.0, NAN, NAN, NAN, NAN)
    session.run_until(FACTS["end_ms"])
    return session
