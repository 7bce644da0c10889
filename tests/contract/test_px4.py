"""Driver and software PX4 on real wires: the same flight, whatever carries the bytes."""

import contextlib
import math
import os
import socket
import tty

import pytest

from hil.contract.wire import memory_pair
from hil.wires.serial import SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
START = (1.0, 0.5, 2.5, 0.0)
LOCAL = "127.0.0.1"


def memory(stack):
    return memory_pair(lambda: 0)


def udp(stack):
    """As with a SITL: PX4 sends first to our fixed port, and answers the first sender."""
    ours = UdpWire((LOCAL, 0), partner="first")
    px4 = UdpWire((LOCAL, 0), ours.address, partner="first", accept_others=True)
    stack.callback(ours.close)
    stack.callback(px4.close)
    return ours, px4


def serial(stack):
    """Two serial ports, each with a pseudo terminal behind it, and a cable between those."""
    masters, ports = [], []
    for _ in range(2):
        master, slave = os.openpty()
        tty.setraw(master)
        os.set_blocking(master, False)
        port = SerialWire(os.ttyname(slave), 921600)
        os.close(slave)
        stack.callback(os.close, master)
        stack.callback(port.close)
        masters.append(master)
        ports.append(port)

    def cable():
        for here, there in (masters, masters[::-1]):
            with contextlib.suppress(BlockingIOError):
                os.write(there, os.read(here, 65536))

    stack.cable = cable
    return ports


class Bridge:
    """The server's end of a TCP connection, as a bridge beside the autopilot holds it."""

    def __init__(self, connection):
        self._connection = connection
        connection.setblocking(False)

    def send(self, data):
        self._connection.sendall(data)

    def receive(self):
        with contextlib.suppress(BlockingIOError):
            return [self._connection.recv(65536)]
        return []


def tcp(stack):
    server = stack.enter_context(socket.create_server((LOCAL, 0)))
    ours = TcpWire(LOCAL, server.getsockname()[1])
    stack.callback(ours.close)
    connection, _ = server.accept()
    return ours, Bridge(stack.enter_context(connection))


@pytest.fixture(params=[memory, udp, tcp, serial], ids=lambda kind: kind.__name__)
def ends(request):
    with contextlib.ExitStack() as stack:
        stack.cable = lambda: None
        pair = request.param(stack)
        yield *pair, lambda: stack.cable()


def test_flight_is_the_same_on_every_wire(ends):
    ours, theirs, cable = ends
    frame = load_airframe("paper_quad")
    sim = Px4Sim({"api": theirs}, frame, 4)
    link = Px4Link(ours, LinkConfig(start=START, hover_thrust=frame.hover_thrust))
    now, out, notes = 0, None, []

    def run(seconds, command=None, until=lambda: False):
        nonlocal now, out
        end = now + round(seconds * 1e9)
        while now < end and not until():
            sim.step(now)
            cable()
            out = link.step(now, command if now % (8 * MS) == 0 else None)
            notes.extend(out.notes)
            cable()
            now += 4 * MS

    run(30.0, until=lambda: link.phase == "hover")
    assert link.phase == "hover", [note.text for note in notes]
    assert math.dist(sim.truth().position, START[:3]) < 0.15
    run(0.6, Rates((0.0, 0.0, 0.5), 9.80665))
    assert sim.truth().body_rate[2] == pytest.approx(0.5, abs=0.1)
    link.release()
    run(20.0, until=lambda: not sim.truth().armed)
    assert not sim.truth().armed
    assert link.counters["garbage"] == 0
    assert sim.rejected["bad_frames"] == sim.rejected["garbage_bytes"] == 0
    assert link.counters["bad_odometry"] == 0
