"""A field without a field: autopilot, car and motion capture, each behind its real wire, in one process of its own.

`python field_world.py AUTOPILOT_PORT CAN_GROUP SCENARIO`: prints {"vrpn": PORT} once everything runs, and how it stands
when it is stopped.
"""

import json
import math
import os
import signal
import sys
import threading
import time
from pathlib import Path

from groundcar.motion.pose import board_position, board_quaternion
from groundcar.scout.sim import ScoutSim
from hil.assembly.board_motion import hover_start, start_board
from hil.assembly.vehicle import EXTERNAL_POSE_PARAMETERS
from hil.wires.can import open_can
from hil.wires.udp import UdpWire
from scenarios.draw import draw
from scenarios.spec import load
from vehicle.mocap.system import Mocap
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

sys.path.append(str(Path(__file__).parents[2]))
from tests.contract.vrpn_server import VrpnServer

LOCAL = "127.0.0.1"
STILL = (0.0, 0.0, 0.0)


def main(port, group, name):
    ended, parent = threading.Event(), os.getppid()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    scenario = load(name)
    drawn = draw(scenario, 0)
    x, y, _, yaw = hover_start(scenario, drawn, 1.0)
    board_row = start_board(scenario, drawn)
    api = UdpWire((LOCAL, 0), (LOCAL, port), partner="first", accept_others=True)
    frame = load_airframe("paper_quad")
    autopilot = Px4Sim({"api": api}, frame, 1, (x, y, 0.0), yaw, parameters=EXTERNAL_POSE_PARAMETERS)
    bus = open_can("udp_multicast", group)
    car = ScoutSim(bus, seed=1, pose=(float(board_row[0]), float(board_row[1]), float(board_row[3])))
    server, noise = VrpnServer(), (Mocap(1), Mocap(2))
    highest, armed, was, told_ns = 0.0, 0, False, 0
    began = time.monotonic_ns()
    print(json.dumps({"vrpn": server.port}), flush=True)
    while not ended.wait(0.004) and os.getppid() == parent:
        now = time.monotonic_ns() - began
        autopilot.step(now)
        car.step(now)
        truth = autopilot.truth()
        highest, armed, was = max(highest, truth.position[2]), armed + (truth.armed and not was), truth.armed
        if now - told_ns >= 10_000_000:
            told_ns = now
            row = car.board_row(scenario.board.height, math.radians(scenario.board.inclination_deg))
            board = tuple(map(float, board_position(row))), board_quaternion(row)
            bodies = {"vehicle": (truth.position, truth.orientation), "board": board}
            poses = {}
            for (body, (p, q)), measured in zip(bodies.items(), noise, strict=True):
                place, _, (w, *turn), _ = measured.measure(p, STILL, q, STILL)
                poses[body] = place, (*turn, w)
            server.send_poses(poses)
    server.close()
    bus.close()
    api.close()
    report = {"armed": armed, "armed_now": was, "highest_m": highest, "position": autopilot.truth().position}
    print(json.dumps(report), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3])
