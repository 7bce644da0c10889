"""Measures motion capture: rate and age of its poses, where its bodies are, and how the car moves by it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from hil.assembly.board_motion import start_board
from hil.assembly.rig import MocapSlot, Rig
from hil.bench.car import CarBench
from hil.bench.reading import Unavailable
from hil.contract.messages import BoardState, VehicleState
from hil.host.lockstep import Clock, Lockstep
from hil.nodes.car import board_of
from hil.nodes.mocap import MocapNode, board_state
from hil.nodes.vehicle_device import VehicleDevice
from hil.wires import WireError
from hil.wires.mocap_vrpn import BodyPose, VrpnMocap
from kernel.rotations import wrap_angle
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.mocap.system import Mocap
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import Airframe

_MS = 1_000_000
_RECEIVE_NS = 1_000_000_000
_CURVE = (0.2, 0.6)  # m/s, rad/s, for a second
_STILL = (0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """m (world), wxyz (world from body)."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]


@dataclass(frozen=True)
class MocapReport:
    """Rate (Hz) and the greatest age (ms) of the newest pose at any moment, the greatest gap between two (ms), and the
    newest poses; None of a body that was not seen."""

    rate_hz: float
    age_ms: float
    gap_ms: float
    source: str
    vehicle: Pose | None = None
    board: Pose | None = None


class CurveReport(NamedTuple):
    """How far a short drive took the car along its heading (m) and about (rad): by motion capture and by its wheels."""

    moved: float
    turned: float
    wheels_moved: float
    wheels_turned: float
    source: str


def measure_mocap(rig: Rig, airframe: Airframe, drawn: Drawn, scenario: Scenario) -> MocapReport:
    """Measure with vehicle and board at rest. Raises Unavailable if nothing arrives."""
    if rig.mocap.kind == "vrpn":
        return _receive(rig.mocap)
    return _modelled(rig, airframe, drawn, scenario)


def measure_curve(slot: MocapSlot, car: CarBench) -> CurveReport:
    """Drive the car through a short curve. Raises Unavailable if it does not drive or its board is not seen."""
    wire = _open(slot)
    try:
        before = _newest(wire.take(0), slot.board_body) or _newest(_listen(wire), slot.board_body)
        wheels = car.try_curve(*_CURVE)
        after = _newest(wire.take(0), slot.board_body) or _newest(_listen(wire), slot.board_body)
    finally:
        wire.close()
    if before is None or after is None:
        raise Unavailable(f'motion capture does not see "{slot.board_body}"')
    old, new = (board_state(0, one.position, _STILL, one.orientation, 0.0) for one in (before, after))
    turned = float(wrap_angle(new.heading - old.heading))
    middle = old.heading + 0.5 * turned
    dx, dy = new.position[0] - old.position[0], new.position[1] - old.position[1]
    moved = dx * math.cos(middle) + dy * math.sin(middle)
    return CurveReport(moved, turned, *wheels, f"VRPN from {slot.server}, and {car.source}")


def _open(slot: MocapSlot) -> VrpnMocap:
    try:
        return VrpnMocap(
            slot.server, (slot.vehicle_body, slot.board_body), round(slot.delay_ms * _MS)
        ).wait_for_bodies()
    except WireError as error:
        raise Unavailable(str(error)) from None


def _listen(wire: VrpnMocap) -> list[BodyPose]:
    """What arrives in a second."""
    poses: list[BodyPose] = []
    began = time.monotonic_ns()
    while time.monotonic_ns() - began < _RECEIVE_NS:
        time.sleep(0.002)
        poses += wire.take(0)
    return poses


def _newest(poses: list[BodyPose], body: str) -> Pose | None:
    return next((Pose(one.position, one.orientation) for one in reversed(poses) if one.body == body), None)


def _receive(slot: MocapSlot) -> MocapReport:
    wire = _open(slot)
    poses_received: list[tuple[int, int]] = []
    poses = wire.take(0)  # those that arrived during the wait are not timed
    began = time.monotonic_ns()
    while time.monotonic_ns() - began < _RECEIVE_NS:
        time.sleep(0.002)
        came = wire.take(0)
        now = time.monotonic_ns() - began
        poses_received += [(now, now - pose.age_ns) for pose in came if pose.body == slot.vehicle_body]
        poses += came
    wire.close()
    bodies = _newest(poses, slot.vehicle_body), _newest(poses, slot.board_body)
    source = f"VRPN from {slot.server}; {slot.delay_ms:g} ms of the age are the rig's setting"
    return _report(poses_received, source, *bodies)


def _modelled(rig: Rig, airframe: Airframe, drawn: Drawn, scenario: Scenario) -> MocapReport:
    clock = Clock()
    device = VehicleDevice(Px4Sim({}, airframe, drawn.vehicle_seed))
    seed = drawn.mocap_seed
    node = MocapNode(Mocap(seed), Mocap(seed + 1), rig.mocap.rate_hz, round(rig.mocap.delay_ms * _MS))
    poses_received: list[tuple[int, int]] = []
    vehicle: list[VehicleState] = []

    def tap(now_ns: int, topic: str, message: object) -> None:
        if topic == "mocap/vehicle" and isinstance(message, VehicleState):
            poses_received.append((now_ns, message.stamp_ns))
            vehicle.append(message)

    Lockstep([device, node], clock, tap).run(lambda now: now >= _RECEIVE_NS)
    board = board_of(0, start_board(scenario, drawn))
    poses = [_pose(one) for one in (*vehicle[-1:], board)]
    return _report(poses_received, "modelled motion capture", poses[0], poses[-1])


def _pose(state: VehicleState | BoardState) -> Pose:
    return Pose(state.position, state.orientation)


def _report(
    poses_received: list[tuple[int, int]], source: str, vehicle: Pose | None, board: Pose | None
) -> MocapReport:
    """`poses_received`: arrival and time of each pose, ns."""
    if len(poses_received) < 2:
        raise Unavailable("motion capture sent nothing in a second")
    gaps = [b[0] - a[0] for a, b in pairwise(poses_received)]
    oldest = max(b[0] - a[1] for a, b in pairwise(poses_received))  # just before the next one arrived
    rate = (len(poses_received) - 1) * 1e9 / (poses_received[-1][0] - poses_received[0][0])
    return MocapReport(rate, oldest / _MS, max(gaps) / _MS, source, vehicle, board)
