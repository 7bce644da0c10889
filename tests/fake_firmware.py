"""A small stand-in for PX4's SITL: the client of the simulator's TCP port, and an offboard link on UDP.

`python -m tests.fake_firmware -i INSTANCE` behaves like the binary as far as this project sees it. It flies by the
software PX4, whose body is set to the true state that it asks for, as PX4 does for its log. FAKE_FIRMWARE (environment)
gives it a fault: mute, exit, no-lockstep or leave.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import socket
import sys
import time
from pathlib import Path

import numpy as np

from hil.wires.udp import UdpWire
from kernel.rotations import swap_attitude, swap_body
from tests.paths import ROOT
from vehicle.px4 import place
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import load_airframe

LOCAL = "127.0.0.1"
TRUTH = 115  # HIL_STATE_QUATERNION
AIRFRAME = "paper_quad"


def build_folder(folder: Path) -> Path:
    """A folder that looks like PX4's build, whose bin/px4 is this module."""
    (folder / "etc/init.d-posix").mkdir(parents=True)
    (folder / "etc/init.d-posix/rcS").touch()
    (folder / "bin").mkdir()
    binary = folder / "bin/px4"
    binary.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m tests.fake_firmware "$@"\n')
    binary.chmod(0o755)
    return folder


def connect(port: int) -> socket.socket:
    until = time.monotonic() + 20.0
    while True:
        try:
            found = socket.create_connection((LOCAL, port))
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.01)
        else:
            found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return found


class FakeFirmware:
    """One fake. `fault`: see the module's text."""

    def __init__(self, instance: int, fault: str = "") -> None:
        self.fault, self.packer, self.parser = fault, Packer(1 + instance, 1), Parser()
        self.tcp = connect(4560 + instance)
        self.udp = UdpWire((LOCAL, 14580 + instance), (LOCAL, 14540 + instance), partner="first", accept_others=True)
        px4.PX4_SYSTEM = 1 + instance
        self.sim = Px4Sim({"api": self.udp}, load_airframe(AIRFRAME))
        self.sim.step(0)  # its clock is that of HIL_SENSOR
        self.port = self.sim.ports["api"]
        self.port.packer = Packer(1 + instance, 1)
        self.steps = 0

    def run(self) -> None:
        self.tcp.sendall(self.packer.send_name("HEARTBEAT", 0, 12, 0, 0, 0, 3))
        self.tcp.sendall(
            self.packer.send_name("COMMAND_LONG", 0, 0, 511, 0, float(TRUTH), 5e3, 0.0, 0.0, 0.0, 0.0, 0.0)
        )
        while True:
            ready = select.select([self.tcp, self.udp], [], [])[0]
            if self.udp in ready:
                self.offboard()
            if self.tcp in ready:
                data = self.tcp.recv(65536)
                if not data:
                    return
                for frame in self.parser.feed(data):
                    if frame.name == "HIL_STATE_QUATERNION":
                        self.set_body(frame.fields)
                    elif frame.name == "HIL_SENSOR":
                        self.step(frame.fields.time_usec)

    def offboard(self) -> None:
        for frame in self.port.receive():
            self.sim.receiver.handle(self.port, frame)
        self.port.flush()

    def set_body(self, f) -> None:
        row = self.sim.row
        east = np.radians(f.lon * 1e-7 - place.ORIGIN_LONGITUDE) * place.EARTH_RADIUS
        row[state_row.P] = east * np.cos(np.radians(place.ORIGIN_LATITUDE))
        row[state_row.P + 1] = np.radians(f.lat * 1e-7 - place.ORIGIN_LATITUDE) * place.EARTH_RADIUS
        row[state_row.P + 2] = f.alt * 1e-3 - place.ORIGIN_ALTITUDE
        row[state_row.V : state_row.V + 3] = 0.01 * f.vy, 0.01 * f.vx, -0.01 * f.vz
        row[state_row.Q : state_row.Q + 4] = swap_attitude(f.attitude_quaternion)
        row[state_row.W : state_row.W + 3] = swap_body(f.rollspeed, f.pitchspeed, f.yawspeed)

    def step(self, time_us: int) -> None:
        self.steps += 1
        if self.fault == "leave" and self.steps > 500:
            sys.exit(1)
        self.sim.step(time_us * 1000)
        if self.fault == "mute":
            return
        armed = self.sim.flight.armed
        motors = self.sim.row[state_row.COMMAND : state_row.COMMAND + 4].tolist() if armed else [0.0] * 4
        flags = 0 if self.fault == "no-lockstep" else 1
        self.tcp.sendall(
            self.packer.send_name("HIL_ACTUATOR_CONTROLS", time_us, (*motors, *(0.0,) * 12), 129 if armed else 1, flags)
        )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("-i", type=int, default=0)
    given, _ = parser.parse_known_args()
    fault = os.environ.get("FAKE_FIRMWARE", "")
    if fault == "exit":
        print("ERROR [init] Unknown model")
        sys.exit(1)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))  # as PX4's threads have it
    FakeFirmware(given.i, fault).run()


if __name__ == "__main__":
    main()
