"""A software PX4 v1.17 behind its MAVLink wires: physics, estimate, control, modes, failsafes, streams, parameters.

It behaves as recordings of a real PX4 SITL do. It reads no clock: `step(now_ns)` brings it to a time, in ticks of
4 ms of PX4 time (250 Hz, physics at 500 Hz), so that the same seed and the same bytes in give the same bytes out.

World ENU and body FLU at this class's edge; NED and FRD only on the wire.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from kernel.random import stream, uniform
from kernel.rotations import from_euler
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.commander import PERIOD_NS, Commander
from vehicle.px4.sim.estimator import Estimator, EstimatorNoise
from vehicle.px4.sim.grip import Grip
from vehicle.px4.sim.outbox import Outbox
from vehicle.px4.sim.params import Parameters, airframe_overrides, apply
from vehicle.px4.sim.plant import TICK_NS, tick
from vehicle.px4.sim.port import Port, Wire
from vehicle.px4.sim.receiver import Receiver
from vehicle.px4.sim.rows import control, situation
from vehicle.px4.sim.state import Flight
from vehicle.px4.sim.streams import add_streams
from vehicle.px4.sim.truth import Quat, Truth, Vec3, truth_of
from vehicle.px4.sim.view import DRAIN_S, View
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import Airframe
from vehicle.quadrotor.dynamics import vehicle_row

SUBSTEPS = 2
READY_S = (4.1, 5.1)  # PX4 time at which the pre-arm checks pass (recorded range)


class Px4Sim:
    """One simulated vehicle with its autopilot. See the module's text."""

    def __init__(
        self,
        links: Mapping[str, Wire | None],
        airframe: Airframe,
        seed: int = 0,
        position: Vec3 = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        parameters: Mapping[str, float] | None = None,
        noise: EstimatorNoise | None = None,
        origin: Vec3 = (0.0, 0.0, 0.0),
        params_row: np.ndarray | None = None,
    ) -> None:
        """Boot at the first `step`.

        links: "api" (Onboard, PX4's 14580) and "gcs" (Normal, 18570), each a wire or None; a link without a wire takes
        no computing time. position (m) and yaw (rad from east, counter-clockwise) ENU of the vehicle, on the ground.
        parameters: set before boot, on top of PX4's defaults and the airframe's values. origin: PX4's local origin in
        the world (m); world and local frame coincide by default, as for a vehicle that is fed by motion capture.
        params_row: the plant's params row if it is not the airframe's own (a randomised vehicle).
        Raises ValueError for unknown links or parameters and numbers that are not finite.
        """
        unknown = set(links) - {"api", "gcs"}
        if unknown:
            raise ValueError(f"unknown links {sorted(unknown)}: a PX4 has 'api' and 'gcs'")
        if not all(map(math.isfinite, (*position, yaw, *origin))):
            raise ValueError(f"start position {position}, yaw {yaw} and origin {origin} must be finite")
        store = Parameters({**airframe_overrides(airframe), **(parameters or {})})
        plant = (airframe.params_row() if params_row is None else params_row).copy()
        row = vehicle_row(position, from_euler(0.0, 0.0, yaw))
        self.flight = flight = Flight(store, row, plant, origin=origin)
        c = flight.control
        c[control.MODE], c[control.OUT_THRUST], c[control.LANDED], c[control.RAMP] = control.OFF, 0.0, 1.0, math.inf
        apply(store, plant, c)
        self._stream = stream(seed, 0x9E4)
        self._noise = (noise or EstimatorNoise()).row()
        flight.situation[situation.GROUND] = position[2]
        flight.situation[situation.HEALTH : situation.HEALTH + 4] = 1.0
        ready_s = uniform(self._stream, *READY_S)
        self.estimator = Estimator(flight, self._stream)
        self.commander = Commander(flight, int(ready_s * 1e9))
        self.view = View(flight, self.commander, self.estimator, self._noise, self._stream)
        self.ports: dict[str, Port] = {}
        for name in ("api", "gcs"):
            wire = links.get(name)
            if wire is not None:
                self.ports[name] = Port(name, wire)
                add_streams(self.ports[name], name)
        self.receiver = Receiver(self.view, self.ports, self._parameters_changed)
        self.outbox = Outbox(self.view, self.ports)
        flight.text, flight.acknowledge = self.outbox.text, self.receiver.acknowledge
        self._boot_ns: int | None = None
        self._commander_ns = 0
        self._grip = Grip(flight.row, flight.situation)
        self._tick()  # fills the estimate
        reset_cascade(c, flight.estimate)

    # -- time -----------------------------------------------------------------------------------------------------

    def step(self, now_ns: int) -> None:
        """Advance to `now_ns` (any epoch; the first call is the moment of boot), then process received frames.

        A frame is processed in the tick that ends at or before `now_ns`; call at least every 4 ms for the least delay.
        """
        if self._boot_ns is None:
            self._boot_ns = now_ns
            return
        flight = self.flight
        target = now_ns - self._boot_ns
        while flight.now_ns + TICK_NS <= target:
            flight.now_ns += TICK_NS
            self._tick()
            if flight.now_ns + TICK_NS > target:
                self._receive()
            if flight.now_ns >= self._commander_ns:
                self._commander_ns += PERIOD_NS
                self._housekeeping()
            self._publish()

    @property
    def boot_ns(self) -> int:
        """PX4 time: nanoseconds since boot."""
        return self.flight.now_ns

    def _tick(self) -> None:
        flight = self.flight
        tick(
            flight.row,
            flight.params,
            flight.control,
            flight.estimate,
            self.estimator.error,
            self._noise,
            self._stream,
            flight.situation,
            TICK_NS * 1e-9,
            SUBSTEPS,
        )

    def _receive(self) -> None:
        for port in self.ports.values():
            for frame in port.receive():
                self.receiver.handle(port, frame)

    def _housekeeping(self) -> None:
        flight = self.flight
        self.estimator.update(PERIOD_NS * 1e-9)
        change = 1.0 if flight.armed else -2.0
        flight.discharge = min(1.0, max(0.0, flight.discharge + change * PERIOD_NS * 1e-9 / DRAIN_S))
        if flight.home is None and flight.global_valid:
            flight.home, flight.home_ns = flight.position, flight.now_ns
        self.commander.update()
        self.receiver.update()
        self.outbox.update()

    def _publish(self) -> None:
        if not self.ports:
            return
        self.view.refresh()
        if self.estimator.vision_used:
            self.estimator.remember()
        self.receiver.next_parameters()
        for port in self.ports.values():
            port.publish(self.view, self.flight.now_ns)
            port.flush()

    def _parameters_changed(self) -> None:
        apply(self.flight.parameters, self.flight.params, self.flight.control)

    # -- truth ----------------------------------------------------------------------------------------------------

    @property
    def row(self) -> np.ndarray:
        """The vehicle's state row (vehicle.quadrotor.state_row): the true state."""
        assert self.flight.row.shape == (state_row.DIM,)
        return self.flight.row

    def truth(self) -> Truth:
        """The vehicle's true state."""
        return truth_of(self.flight.row, self.flight.armed, self._grip.holds)

    # -- acts of the world on it -------------------------------------------------------------------------------------

    def set_wind(self, velocity: Vec3) -> None:
        """Velocity of the air (m/s, world) from now on."""
        self.flight.row[state_row.WIND : state_row.WIND + 3] = velocity

    def attach(
        self,
        board_position: Vec3,
        board_orientation: Quat,
        stamp_ns: int | None = None,
        board_velocity: Vec3 = (0.0, 0.0, 0.0),
        board_turn_rate: float = 0.0,
    ) -> None:
        """The magnet holds: from the first call on the vehicle keeps its pose in the board's frame.

        Call again with every new pose of the board (m, world; quaternion world from board); between calls the vehicle
        moves on with the board's last motion. `stamp_ns` is when the pose is true, on `step`'s clock (None: as of the
        last step); a pose for the step to come would otherwise put the vehicle ahead by one step. Velocity (m/s, world)
        and turn rate (rad/s, about the vertical) are used at the first call only: later two poses give them. `detach`
        ends it.
        """
        now = self.flight.now_ns
        stamp = now if stamp_ns is None or self._boot_ns is None else stamp_ns - self._boot_ns
        self._grip.attach(now, stamp, board_position, board_orientation, board_velocity, board_turn_rate)

    def detach(self) -> None:
        """The magnet lets go; the vehicle leaves with the board's velocity."""
        self._grip.detach()

    @property
    def params(self) -> np.ndarray:
        """The plant's params row (vehicle.quadrotor.airframe_row)."""
        return self.flight.params

    @property
    def estimate_error(self) -> np.ndarray:
        """The error row of the estimate (rows.estimate_error)."""
        return self.estimator.error

    # -- faults ---------------------------------------------------------------------------------------------------

    def fail_motor(self, motor: int, remaining: float = 0.0) -> None:
        """Motor 0..3 gives only the share `remaining` (0..1) of its commanded thrust; 1 repairs it."""
        if not (0 <= motor < 4 and 0.0 <= remaining <= 1.0):
            raise ValueError(f"motor {motor} with {remaining} of its thrust: give a motor 0..3 and a share 0..1")
        self.flight.situation[situation.HEALTH + motor] = remaining

    def drain(self) -> None:
        """The battery is empty now."""
        self.flight.discharge = 1.0

    def set_gps(self, enabled: bool) -> None:
        """Switch GPS reception off or on."""
        self.estimator.gps_enabled = enabled

    def set_heartbeat(self, enabled: bool) -> None:
        """Stop sending HEARTBEAT on all links, or resume."""
        for port in self.ports.values():
            (port.silent.discard if enabled else port.silent.add)(px4.mavlink.MAVLINK_MSG_ID_HEARTBEAT)

    @property
    def rejected(self) -> dict[str, int]:
        """Counted rejections: garbage bytes, broken, unknown and ignored frames, unusable set-points."""
        parsers = [port.parser for port in self.ports.values()]
        return {
            "garbage_bytes": sum(p.garbage_bytes for p in parsers),
            "bad_frames": sum(p.bad_frames for p in parsers),
            "unknown_frames": sum(p.unknown_frames for p in parsers),
            "ignored_frames": self.receiver.ignored,
            "setpoints": self.commander.offboard.rejected,
        }
