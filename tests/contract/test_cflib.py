"""cflib, Bitcraze's own client, on the software Crazyflie over UDP, as it speaks to the firmware in simulation.

The Crazyflie's time is the test's: it goes on by steps between which cflib's threads get time to receive and answer.
"""

import itertools
import math
import time

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig

from hil.wires.udp import UdpWire
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.crazyflie.sim.supervisor import State
from vehicle.quadrotor.airframe import load_airframe

LIMIT_S = 60.0  # for what cflib's threads have to do
MS = 1_000_000
HOVER = 41650


class Bench:
    """A software Crazyflie on a UDP port, and cflib connected to it."""

    def __init__(self, connect=True, **options):
        self.wire = UdpWire(("127.0.0.1", 0), partner="last")
        self.sim = CrazyflieSim(self.wire, load_airframe("crazyflie"), 1, **options)
        self.now = 0
        self.sim.step(0)
        self.client = Crazyflie()
        self.uri = f"udp://127.0.0.1:{self.wire.address[1]}"
        self.events = []
        for name in ("fully_connected", "connection_failed", "connection_lost"):
            getattr(self.client, name).add_callback(lambda *_, name=name: self.events.append(name))
        if connect:
            self.client.open_link(self.uri)
            self.until(lambda: self.events, "the connection")
            assert self.events == ["fully_connected"]

    def step(self, ms=2):
        self.now += ms * MS
        self.sim.step(self.now)

    def until(self, condition, what):
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end, f"{what} took more than {LIMIT_S:g} s"
            self.step()
            time.sleep(0.0005)

    def run(self, ms, every=None):
        """`ms` of the Crazyflie's time in steps of 10 ms, motion capture and `every` at each."""
        for _ in range(ms // 10):
            truth = self.sim.truth()
            w, x, y, z = truth.orientation
            self.client.extpos.send_extpose(*truth.position, x, y, z, w)
            if every is not None:
                every()
            for _ in range(5):
                self.step()

    def take_off(self):
        self.run(300)
        self.client.supervisor.send_arming_request(True)
        self.run(200)
        self.client.high_level_commander.takeoff(1.5, 2.0)
        self.run(3500)
        assert self.sim.truth().position[2] == pytest.approx(1.5, abs=0.1)

    def close(self):
        self.client.close_link()
        self.wire.close()


@pytest.fixture(scope="module", autouse=True)
def drivers():
    cflib.crtp.init_drivers()


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.close()


def test_cflib_connects_and_reads_both_tables_and_logs_at_100_hz(bench):
    assert bench.client.platform.get_protocol_version() == 12
    variables = {f"{group}.{name}" for group, names in bench.client.log.toc.toc.items() for name in names}
    assert variables == set(bench.sim._log.contents.numbers)
    parameters = {f"{group}.{name}" for group, names in bench.client.param.toc.toc.items() for name in names}
    assert parameters == set(bench.sim.receiver._parameters.contents.numbers)
    assert float(bench.client.param.get_value("pm.lowVoltage")) == pytest.approx(3.2)

    block, rows = LogConfig("state", 10), []
    for name in ("stateEstimate.x", "stateEstimate.z", "stateEstimateZ.vz", "pm.vbat", "supervisor.info"):
        block.add_variable(name)
    bench.client.log.add_config(block)
    block.data_received_cb.add_callback(lambda stamp, values, _: rows.append((stamp, values)))
    block.start()
    bench.until(lambda: len(rows) > 1, "the first log data")
    for count in range(25, 125, 25):  # in parts, so that the client's socket never holds many packets
        bench.run(250)
        bench.until(lambda count=count: len(rows) >= count, "log data")
    assert {b[0] - a[0] for a, b in itertools.pairwise(rows)} == {10}
    assert 3.5 < rows[-1][1]["pm.vbat"] < 4.2
    bench.client.param.set_value("supervisor.prefltTimeout", 12000)
    bench.until(lambda: bench.sim.flight.supervisor.preflight_timeout_ns == 12_000 * MS, "the parameter")


def test_cflib_flies_rates_and_its_lost_stream_levels_and_then_stops_the_vehicle(bench):
    bench.take_off()
    client = bench.client

    def manual(roll, pitch, yaw):
        share = 100.0 * (HOVER - 10001) / (60000 - 10001)
        return lambda: client.commander.send_setpoint_manual(roll, pitch, yaw, share, True)

    for axis, rates in enumerate(((40.0, 0.0, 0.0), (0.0, 40.0, 0.0), (0.0, 0.0, 40.0))):
        bench.run(200, manual(*rates))
        assert math.degrees(bench.sim.truth().body_rate[axis]) == pytest.approx(40.0, abs=15.0)
        bench.run(200, manual(*(-rate for rate in rates)))
    bench.run(100, manual(0.0, 0.0, 0.0))
    bench.run(450)
    assert bench.sim.flight.supervisor.state == State.FLYING
    bench.run(120)
    assert bench.sim.flight.supervisor.state == State.LEVEL_OUT
    assert "Is flying" in client.supervisor.decode_bitfield(bench.sim.flight.info)
    bench.run(1600)
    assert bench.sim.flight.supervisor.state == State.LOCKED
    bench.run(200)
    assert max(bench.sim.truth().motors) < 0.05


def test_cflib_stops_the_vehicle_in_an_emergency(bench):
    bench.take_off()
    bench.client.supervisor.send_emergency_stop()
    bench.run(100)
    assert bench.sim.flight.supervisor.state == State.LOCKED
