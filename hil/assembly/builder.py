"""Scenario + rig + drawn numbers -> any one node of a run. Every node can be built by itself, in a process of its own:
nothing is shared between two of them but the wires, which are the host's business.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

from groundcar.board.layout import Board
from groundcar.scout.dead_reckoning import DeadReckoning
from groundcar.scout.driver import ScoutLink
from groundcar.scout.follower import Follower
from groundcar.scout.params import load_scout
from groundcar.scout.sim import ScoutSim
from hil.assembly.board_motion import hover_start, motion_aux, start_board, start_parameter
from hil.assembly.rig import Rig
from hil.assembly.sensing import camera_node, mocap_node, mounted_cameras
from hil.contract.node import Node
from hil.nodes.belief import BeliefNode
from hil.nodes.car import CarDevice, CarFollower, CarLink
from hil.nodes.detector import Detector
from hil.nodes.director import Director
from hil.nodes.policy import PolicyNode
from hil.nodes.referee import Referee
from hil.nodes.vehicle import VehicleDevice, VehicleLink
from hil.safety.gate import CarGate, Gate
from hil.wires.signing_key import read_signing_key
from kernel.random import stream
from policies.estimation.board_filter import BoardFilter
from policies.task.contact import ContactRules
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.apriltag.detector import BoardDetector
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Signing
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor import airframe as af
from vehicle.quadrotor.wind import Wind

PREPARE_LIMIT_NS = 90_000_000_000
PREPARE_LIMIT_REAL_NS = 130_000_000_000  # a SITL lags behind wall time
# What lets the software PX4 fly on external poses alone, as it must be set on a real one before it boots.
EXTERNAL_POSE_PARAMETERS = {
    "EKF2_EV_CTRL": 11, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SYS_HAS_GPS": 0, "SENS_EN_GPSSIM": 0,
}  # fmt: skip


class Wires(Protocol):
    """The host's wires: the driver's and the simulated device's end of each, opened when asked for."""

    def vehicle_link(self) -> Any: ...
    def vehicle_device(self) -> Any: ...
    def car_link(self) -> Any: ...
    def car_device(self) -> Any: ...


def node_names(rig: Rig) -> tuple[str, ...]:
    """The nodes of a run with `rig`, in the order in which they act within one instant."""
    absent = {
        "car_device": rig.groundcar.kind != "sim",
        "vehicle_device": rig.vehicle.kind != "sim",
        "detector": rig.camera.source != "pictures",
    }
    order = (
        "car_device", "vehicle_device", "mocap", "director", "referee", "car_follower", "car_link", "camera",
        "detector", "vehicle_link", "belief", "policy",
    )  # fmt: skip
    return tuple(name for name in order if not absent.get(name, False))


class Assembly:
    """Builds the nodes of one run. `stopwatch` (ns) is given by hosts in which a detection costs real time."""

    def __init__(
        self,
        scenario: Scenario,
        rig: Rig,
        drawn: Drawn,
        make_policy: Callable[[], FlyingPolicy],
        wires: Wires,
        stopwatch: Callable[[], int] | None = None,
        unix_ns: int = 0,
    ) -> None:
        """`unix_ns`: the date (Unix time) at which the run begins, for signatures on a real vehicle's link."""
        self._scenario, self._rig, self._drawn = scenario, rig, drawn
        self._make_policy, self._wires, self._stopwatch = make_policy, wires, stopwatch
        self._unix_ns = unix_ns
        self._frame = af.load_airframe(rig.vehicle.airframe)
        self.camera = mounted_cameras(rig.camera, self._frame, drawn)[1]

    @property
    def names(self) -> tuple[str, ...]:
        """The run's nodes, in the order in which they act within one instant."""
        return node_names(self._rig)

    @property
    def device_nodes(self) -> tuple[str, ...]:
        """Nodes that take what they publish from a device, not from their inputs."""
        rig = self._rig
        kinds = {"camera": rig.camera.kind, "mocap": rig.mocap.kind}
        return tuple(name for name, kind in kinds.items() if kind != "sim")

    def node(self, name: str) -> Node:
        """A fresh node of that name. Raises ValueError if this rig has none, and what its builder raises."""
        if name not in self.names:
            raise ValueError(f"this rig has no node {name!r}; it has {', '.join(self.names)}")
        return getattr(self, f"_{name}")()

    def _vehicle_device(self) -> VehicleDevice:
        drawn, frame = self._drawn, self._frame
        x, y, _, yaw = self._start()
        params = frame.params_row()
        params[af.MASS] *= drawn.mass_factor
        params[af.INERTIA : af.INERTIA + 3] *= drawn.inertia_factor
        params[af.DRAG : af.DRAG + 3] *= drawn.drag_factor
        params[af.MOTOR_THRUST] *= drawn.mass_factor * drawn.thrust_to_weight_factor * drawn.thrust_gain
        wire = self._wires.vehicle_device()
        parameters = EXTERNAL_POSE_PARAMETERS if self._rig.vehicle.external_pose else None
        sim = Px4Sim(
            {"api": wire}, frame, drawn.vehicle_seed, (x, y, 0.0), yaw, parameters=parameters, params_row=params
        )
        return VehicleDevice(sim, self._wind())

    def _wind(self) -> Wind | None:
        wind = self._scenario.wind
        if wind.gust == 0.0 and not any(wind.mean):
            return None
        return Wind(wind.mean, wind.gust, wind.gust_time, self._drawn.wind_seed)

    def _vehicle_link(self) -> VehicleLink:
        slot, real = self._rig.vehicle, self._rig.vehicle.kind != "sim"
        steepest = math.radians(self._scenario.board.inclination_deg)
        config = LinkConfig(
            start=self._start(), hover_thrust=self._frame.hover_thrust, steepest=steepest,
            hover_position=slot.hover_position, hover_speed=slot.hover_speed, hover_turning=slot.hover_turning,
            external_vision=slot.external_pose,
        )  # fmt: skip
        if real:
            config = replace(
                config,
                system=slot.system,
                component=slot.component,
                clock_drift=slot.clock_drift,
                signing=_signing(slot.signing_key, self._unix_ns),
            )
        seen_by_simulation = real and "sim" in (self._rig.camera.kind, self._rig.mocap.kind)
        link = Px4Link(self._wires.vehicle_link(), config)
        virtual_board = real and "sim" in (self._rig.groundcar.kind, self._rig.mocap.kind)
        return VehicleLink(link, Gate(self._rig.gate), seen_by_simulation, slot.external_pose, virtual_board)

    def _start(self) -> tuple[float, float, float, float]:
        return hover_start(self._scenario, self._drawn, load_scout().follower.acceleration)

    def _car_device(self) -> CarDevice:
        board = self._scenario.board
        sim = ScoutSim(self._wires.car_device(), seed=self._drawn.car_seed, pose=self._car_start())
        return CarDevice(sim, board.height, math.radians(board.inclination_deg))

    def _car_start(self) -> tuple[float, float, float]:
        board = start_board(self._scenario, self._drawn)
        return float(board[0]), float(board[1]), float(board[3])

    def _car_link(self) -> CarLink:
        rig, board = self._rig, self._scenario.board
        seen = DeadReckoning(self._car_start(), board.height, math.radians(board.inclination_deg))
        seen_by_simulation = rig.groundcar.kind != "sim" and "sim" in (rig.camera.kind, rig.mocap.kind)
        link = ScoutLink(self._wires.car_link())
        return CarLink(link, CarGate(rig.car_gate), seen if seen_by_simulation else None)

    def _car_follower(self) -> CarFollower:
        aux = motion_aux(self._scenario, self._drawn)
        start = start_parameter(self._scenario, self._drawn, aux)
        return CarFollower(Follower(aux, start, stream(self._drawn.speed_seed)))

    def _mocap(self) -> Node:
        return mocap_node(self._rig.mocap, self._drawn, self._stopwatch is not None)

    def _director(self) -> Director:
        limit_ns = PREPARE_LIMIT_NS if self._rig.vehicle.kind == "sim" else PREPARE_LIMIT_REAL_NS
        return Director(round(self._scenario.car.lead * 1e9), limit_ns)

    def _referee(self) -> Referee:
        return Referee(_rules(self._scenario, self._frame), math.radians(self._scenario.board.inclination_deg))

    def _camera(self) -> Node:
        return camera_node(self._scenario, self._rig.camera, self._frame, self._drawn, self._stopwatch is not None)

    def _detector(self) -> Detector:
        return Detector(BoardDetector(self.camera, self._board()), self.camera.row(), self._stopwatch)

    def _belief(self) -> BeliefNode:
        return BeliefNode(BoardFilter())

    def _policy(self) -> PolicyNode:
        return PolicyNode(self._make_policy())

    def _board(self) -> Board:
        return Board(size=self._scenario.board.size)


def _signing(path: str, unix_ns: int) -> Signing | None:
    """The signing of the vehicle's link with the key in the file `path`; None without one."""
    if not path:
        return None
    return Signing(key=read_signing_key(path), epoch_ns=unix_ns)


def _rules(scenario: Scenario, frame: af.Airframe) -> ContactRules:
    tolerance, space = scenario.tolerance, scenario.workspace
    return ContactRules(
        robot_l=frame.contact.magnet_below,
        robot_r=frame.contact.footprint_radius,
        delta_d=tolerance.distance,
        delta_v=tolerance.tangential_speed,
        delta_theta=tolerance.angle,
        ground_z=space.z[0],
        workspace_xy=max(abs(limit) for limit in (*space.x, *space.y)),
        workspace_z=space.z[1],
        time_limit=scenario.time_limit,
    )
