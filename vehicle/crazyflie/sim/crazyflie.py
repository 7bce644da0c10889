"""A software Crazyflie 2.1 behind CRTP: physics, estimate, control, supervisor, log, parameters, commanders.

It reads no clock: `step(now_ns)` brings it to a time in ticks of 2 ms, so that the same seed and the same bytes in give
the same bytes out. It behaves as Bitcraze's firmware of protocol version 12 as far as a client can see; body rate loop
and cascade are the ones of the software PX4 with this vehicle's gains, not the firmware's PIDs.

World ENU and body FLU, which the firmware has too, but for its pitch.
"""

from __future__ import annotations

import math

import numpy as np

from kernel.random import stream
from kernel.rotations import from_euler
from vehicle.crazyflie.crtp import MOST_DATA, PROTOCOL_VERSION, Packet, Port, pack, unpack
from vehicle.crazyflie.sim.battery import Battery
from vehicle.crazyflie.sim.commander import Commander, apply
from vehicle.crazyflie.sim.estimator import NOISE, Estimator
from vehicle.crazyflie.sim.gains import GAINS
from vehicle.crazyflie.sim.high_level import HighLevel
from vehicle.crazyflie.sim.log import LogService
from vehicle.crazyflie.sim.receiver import Receiver
from vehicle.crazyflie.sim.state import Flight
from vehicle.crazyflie.sim.supervisor import PERIOD_NS, Supervisor, in_g
from vehicle.crazyflie.sim.variables import log_variables
from vehicle.crazyflie.thrust import FULL_FORCE, available_force
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.grip import Grip
from vehicle.px4.sim.plant import tick
from vehicle.px4.sim.port import Wire
from vehicle.px4.sim.rows import control, situation
from vehicle.px4.sim.truth import Quat, Truth, Vec3, truth_of
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor.airframe import GRAVITY, Airframe
from vehicle.quadrotor.dynamics import vehicle_row

TICK_NS = 2_000_000


class CrazyflieSim:
    """One simulated Crazyflie on one wire. See the module's text."""

    def __init__(
        self,
        wire: Wire | None,
        airframe: Airframe,
        seed: int = 0,
        position: Vec3 = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        params_row: np.ndarray | None = None,
        auto_arm: bool = False,
        charge: float = 1.0,
        protocol_version: int = PROTOCOL_VERSION,
    ) -> None:
        """Boot at the first `step`.

        wire: carries one CRTP packet per datagram. position (m) and yaw (rad from east, counter-clockwise) ENU of the
        vehicle, on the ground. params_row: the plant's params row if it is not the airframe's own (a randomised
        vehicle). auto_arm: a build that does not require arming. charge: of the battery, 0..1. protocol_version: what
        it says of itself. Raises ValueError for numbers that are not finite and an airframe that cannot lift itself
        with what the firmware gives its motors.
        """
        if not all(map(math.isfinite, (*position, yaw))):
            raise ValueError(f"start position {position} and yaw {yaw} must be finite")
        if airframe.body.mass * GRAVITY >= 4.0 * FULL_FORCE:
            raise ValueError(f"{airframe.name} weighs {airframe.body.mass} kg: a Crazyflie's motors lift 0.048 kg")
        self._wire = wire
        self._console: list[str] = []
        self._params = (airframe.params_row() if params_row is None else params_row).copy()
        self._stream = stream(seed, 0xC4A2)
        self.flight = flight = Flight(
            vehicle_row(position, from_euler(0.0, 0.0, yaw)),
            float(airframe.params_row()[airframe_row.MOTOR_THRUST]),
            Supervisor(auto_arm, self._console.append),
            Commander(HighLevel()),
            Estimator(self._stream),
            Battery(charge),
        )
        flight.body[situation.GROUND] = position[2]
        flight.body[situation.HEALTH : situation.HEALTH + 4] = 1.0
        c = flight.control
        c[control.MODE], c[control.OUT_THRUST], c[control.RAMP], c[control.SMOOTH] = control.OFF, 0.0, math.inf, 0.0
        for at, name in enumerate(control.PARAMETERS):
            c[control.GAINS + at] = GAINS[name]
        c[control.THR_HOVER] = airframe.hover_thrust
        for at, name in enumerate(("MAX_XY", "MAX_UP", "MAX_DOWN", "MAX_TILT")):
            c[control.MAX_XY + at] = GAINS[name]
        self._log = LogService(*log_variables(flight))
        self.receiver = Receiver(flight, self._log, protocol_version)
        self._grip = Grip(flight.row, flight.body)
        self._supervisor_ns = 0
        self._boot_ns: int | None = None
        self.malformed = 0  # datagrams that are no packet
        self._tick(thrusting=False)  # fills the estimate
        reset_cascade(c, flight.estimate)

    # -- time -----------------------------------------------------------------------------------------------------

    def step(self, now_ns: int) -> None:
        """Advance to `now_ns` (any epoch; the first call is the moment of boot); packets are taken at its beginning."""
        if self._boot_ns is None:
            self._boot_ns = now_ns
            return
        flight, target = self.flight, now_ns - self._boot_ns
        if flight.now_ns + TICK_NS <= target:
            self._receive()
        while flight.now_ns + TICK_NS <= target:
            flight.now_ns += TICK_NS
            self._control_step()
            for packet in self._log.due(flight.now_ns):
                self._send(packet)
        for text in self._console:
            for at in range(0, len(text), MOST_DATA):
                self._send(Packet(Port.CONSOLE, 0, text[at : at + MOST_DATA].encode("latin-1")))
        self._console.clear()

    def _receive(self) -> None:
        for datagram in self._wire.receive() if self._wire is not None else ():
            packet = unpack(datagram)
            if packet is None:
                self.malformed += 1
                continue
            answer = self.receiver.handle(packet)
            if answer is not None:
                self._send(answer)

    def _send(self, packet: Packet) -> None:
        if self._wire is not None:
            self._wire.send(pack(packet))

    def _control_step(self) -> None:
        flight = self.flight
        supervisor, commander, row, now = flight.supervisor, flight.commander, flight.row, flight.now_ns
        if not supervisor.can_fly:
            commander.high_level.stop()
        commander.update(now, flight.position, flight.heading)
        motors = row[state_row.COMMAND : state_row.COMMAND + 4]
        if now >= self._supervisor_ns:
            self._supervisor_ns += PERIOD_NS
            x, y, z = row[state_row.F : state_row.F + 3].tolist()
            supervisor.update(now, in_g((x, y, z), GRAVITY), bool(motors.max() > 0.0), commander.stamp_ns)
        force = available_force(flight.battery.voltage)
        apply(
            commander.setpoint,
            commander.acceleration,
            supervisor.levels_out,
            flight.heading,
            force,
            flight.full_force,
            flight.control,
        )
        self._tick(supervisor.can_fly and commander.thrusts())
        dt = TICK_NS * 1e-9
        flight.battery.use(float(motors.mean()), dt)
        flight.estimator.drift(now, dt)

    def _tick(self, thrusting: bool) -> None:
        flight, body = self.flight, self.flight.body
        if thrusting and body[situation.ARMED] == 0.0:
            reset_cascade(flight.control, flight.estimate)
        body[situation.ARMED] = 1.0 if thrusting else 0.0
        flight.control[control.LANDED] = 0.0 if thrusting else 1.0
        tick(
            flight.row,
            self._params,
            flight.control,
            flight.estimate,
            flight.estimator.error,
            NOISE,
            self._stream,
            body,
            TICK_NS * 1e-9,
            1,
        )

    # -- truth, and acts of the world on it ------------------------------------------------------------------------

    def truth(self) -> Truth:
        """The vehicle's true state. One that arms itself counts as armed while it flies."""
        supervisor = self.flight.supervisor
        armed = supervisor.flying or (supervisor.armed and not supervisor.auto_arms)
        return truth_of(self.flight.row, armed, self._grip.holds)

    @property
    def row(self) -> np.ndarray:
        """The vehicle's state row (vehicle.quadrotor.state_row): the true state."""
        return self.flight.row

    @property
    def params(self) -> np.ndarray:
        """The plant's params row (vehicle.quadrotor.airframe_row)."""
        return self._params

    @property
    def estimate_error(self) -> np.ndarray:
        """The error row of the estimate (vehicle.px4.sim.rows.estimate_error)."""
        return self.flight.estimator.error

    def drain(self) -> None:
        """The battery is empty now."""
        self.flight.battery.charge = 0.0

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
        """The board holds it from the first call on; see `vehicle.px4.sim.grip.Grip.attach`. `stamp_ns` on `step`'s
        clock; None: as of the last step."""
        stamp = self.flight.now_ns if stamp_ns is None or self._boot_ns is None else stamp_ns - self._boot_ns
        self._grip.attach(self.flight.now_ns, stamp, board_position, board_orientation, board_velocity, board_turn_rate)

    def detach(self) -> None:
        """The board lets go."""
        self._grip.detach()

    def fail_motor(self, motor: int, remaining: float = 0.0) -> None:
        """Motor 0..3 gives only the share `remaining` (0..1) of its commanded thrust; 1 repairs it."""
        if not (0 <= motor < 4 and 0.0 <= remaining <= 1.0):
            raise ValueError(f"motor {motor} with {remaining} of its thrust: give a motor 0..3 and a share 0..1")
        self.flight.body[situation.HEALTH + motor] = remaining
