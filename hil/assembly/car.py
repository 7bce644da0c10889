"""The car's nodes: follower, driver with its gate, and the simulated car behind the wire."""

from __future__ import annotations

from groundcar.motion import board_row
from groundcar.scout.dead_reckoning import DeadReckoning
from groundcar.scout.driver import ScoutLink
from groundcar.scout.follower import Follower, RecordedFollower
from groundcar.scout.sim import ScoutSim
from hil.assembly.board_motion import Ride, motion_aux, start_board, start_parameter
from hil.assembly.parts import Parts
from hil.assembly.recorded_motion import recorded_motion
from hil.nodes.car import CarDevice, CarFollower, CarLink
from hil.safety.car_gate import CarGate
from kernel.random import stream
from scenarios.spec import RecordedPath


def car_device(parts: Parts) -> CarDevice:
    """The simulated car at its start."""
    sim = ScoutSim(parts.wires.car_device(), seed=parts.drawn.car_seed, pose=_start(parts))
    recorded = recorded_motion(parts.scenario) if isinstance(parts.scenario.path, RecordedPath) else None
    return CarDevice(sim, Ride(parts.scenario), recorded)


def car_link(parts: Parts) -> CarLink:
    """The driver of a simulated or real car."""
    rig = parts.rig
    seen = DeadReckoning(_start(parts), parts.scenario.board.height, parts.inclination)
    seen_by_simulation = rig.groundcar.kind != "sim" and "sim" in (rig.camera.kind, rig.mocap.kind)
    link = ScoutLink(parts.wires.car_link())
    return CarLink(link, CarGate(rig.car_gate), seen if seen_by_simulation else None)


def car_follower(parts: Parts) -> CarFollower:
    """What drives the car along the scenario's motion."""
    if isinstance(parts.scenario.path, RecordedPath):
        return CarFollower(RecordedFollower(recorded_motion(parts.scenario)))
    aux = motion_aux(parts.scenario, parts.drawn)
    start = start_parameter(parts.scenario, parts.drawn, aux)
    return CarFollower(Follower(aux, start, stream(parts.drawn.speed_seed)))


def _start(parts: Parts) -> tuple[float, float, float]:
    """Where the car waits: x, y m (world), heading rad."""
    board = start_board(parts.scenario, parts.drawn)
    return float(board[board_row.X]), float(board[board_row.Y]), float(board[board_row.HEADING])
