"""The software PX4 like a SITL: a separate process that boots, sends first to a UDP port, and lags wall time.

`python px4_process.py PORT [SPEED]`: instance 0 of a PX4 on a free port, speaking to 127.0.0.1:PORT; SPEED is PX4 time
over wall time. Runs until it is stopped; the last line that it prints reports its flight.
"""

import json
import math
import os
import signal
import sys
import threading
import time

from hil.wires.udp import UdpWire
from kernel.rotations import body_z
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.px4.sim.estimator import GPS_NOISE
from vehicle.quadrotor.airframe import load_airframe

LOCAL = "127.0.0.1"
TICK_S = 0.004


def main(port: int, speed: float) -> None:
    ended, parent = threading.Event(), os.getppid()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    wire = UdpWire((LOCAL, 0), (LOCAL, port), partner="first", accept_others=True)
    sim = Px4Sim({"api": wire}, load_airframe("sih_quad"), 1, noise=GPS_NOISE)
    highest, armed, tilt, fall = 0.0, 0, 0.0, 0.0
    was, truth = False, sim.truth()
    sim.step(0)
    print("booted", flush=True)
    began = time.monotonic_ns()
    while not ended.wait(TICK_S) and os.getppid() == parent:
        sim.step(round(speed * (time.monotonic_ns() - began)))
        truth = sim.truth()
        highest, fall = max(highest, truth.position[2]), max(fall, -truth.velocity[2])
        tilt = max(tilt, math.degrees(math.acos(min(1.0, body_z(truth.orientation)[2]))))
        armed += truth.armed and not was
        was = truth.armed
    wire.close()
    rejected = {name: count for name, count in sim.rejected.items() if count}
    report = {
        "armed": armed,
        "armed_now": was,
        "highest_m": highest,
        "tilt_deg": tilt,
        "fastest_fall": fall,
        "position": truth.position,
    }
    print(json.dumps(report | {"rejected": rejected}), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 0.98)
