"""The simulated vehicle behind PX4's simulator interface: sensors out, motor controls in, our plant between them.

Over TCP with a firmware in lockstep each tick waits for the firmware's answer, whose clock is the tick's. Over a serial
port with a flight controller in HITL mode time is real: sensors go out with each tick, the newest controls count.
It reads no clock: the wire waits, and says when it has waited in vain.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from kernel.random import stream
from kernel.rotations import from_euler
from vehicle.px4.codec import Parser
from vehicle.px4.hitl.controls import MotorControls
from vehicle.px4.hitl.messages import hil_state
from vehicle.px4.hitl.sensors import SensorNoise
from vehicle.px4.hitl.suite import SensorSuite
from vehicle.px4.protocol import AUTOPILOT_PX4, BaseMode, Command, mavlink
from vehicle.px4.sim.grip import Grip
from vehicle.px4.sim.plant import TICK_NS, body_tick
from vehicle.px4.sim.rows import situation
from vehicle.px4.sim.truth import Quat, Truth, Vec3, truth_of
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import Airframe
from vehicle.quadrotor.dynamics import vehicle_row

BASE_US = 1_000_000  # the firmware's time at ours of 0: a stamp of 0 is none for PX4
SUBSTEPS = 2
_CATCH_UP = 25  # ticks in one step: a firmware that lags behind real time is not chased for longer
_NO_BATTERY = 65535  # mV: not measured
_MUTE = 1500  # the same before its first answer, while it starts its modules
_TRUTH = 5  # ticks between two true states at least: SITL asks for all of them, a flight log is read at 50 Hz
_SILENT = 20  # answers that may stay out one after the other


class SimulatorWire(Protocol):
    """Bytes to and from the firmware. `receive` of a wire in lockstep waits until something has come, and returns
    nothing only after it has waited in vain; that of a serial port never waits."""

    lockstep: bool

    def mark_answered(self, answered: bool, /) -> object:
        """Whether controls have come: before, the firmware still starts its modules."""

    def restart(self) -> object:
        """End the firmware as a loss of power does, and start it anew."""

    def send(self, data: bytes, /) -> object: ...

    def receive(self) -> list[bytes]: ...


class FirmwareFault(RuntimeError):
    """The firmware cannot be flown; the text says why and what to do."""


class HitlVehicle:
    """One vehicle whose autopilot is a real firmware. The methods of the software PX4's body: `step`, `truth`,
    `attach`, `set_wind`."""

    def __init__(
        self,
        wire: SimulatorWire,
        airframe: Airframe,
        seed: int = 0,
        position: Vec3 = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        params_row: np.ndarray | None = None,
        noise: SensorNoise | None = None,
        gps: bool = True,
        powered: bool = False,
    ) -> None:
        """On the ground at `position` (m, world), heading `yaw` (rad from east, counter-clockwise).

        `params_row`: the plant's if it is not the airframe's own. `gps`: False where the autopilot has motion capture
        only. `powered`: a flight controller may have its motors' battery connected.
        """
        self._wire, self._powered = wire, powered
        self._row = vehicle_row(position, from_euler(0.0, 0.0, yaw))
        self._params = (airframe.params_row() if params_row is None else params_row).copy()
        self._body = np.zeros(situation.LENGTH)
        self._body[situation.GROUND] = position[2]
        self._body[situation.HEALTH : situation.HEALTH + 4] = 1.0
        self._grip = Grip(self._row, self._body)
        self.sensors = SensorSuite(self._row, noise or SensorNoise(), stream(seed, 0x417), gps)
        self._parser = Parser()
        self.controls = MotorControls()
        self.unanswered = 0  # ticks that the firmware did not answer
        self._silent = 0
        self._start_ns: int | None = None
        self._now_ns = 0
        self._ticks = 0
        self._truth_ticks = 0  # between two true states for the firmware's log; 0: it wants none
        self._notes: list[str] = []
        self._admitted = wire.lockstep  # a flight controller must first say what it is
        self._hitl = self._unpowered = False
        self._lagging = False

    # -- time -----------------------------------------------------------------------------------------------------

    def step(self, now_ns: int) -> None:
        """Advance to `now_ns` in ticks of 4 ms; the first call is the moment at which the firmware's time begins.

        Raises FirmwareFault for a firmware that does not answer or must not be flown.
        """
        if self._start_ns is None:
            self._start_ns = now_ns
            self._exchange()
            return
        target = now_ns - self._start_ns
        for _ in range(_CATCH_UP):
            if self._now_ns + TICK_NS > target:
                return
            self._now_ns += TICK_NS
            body_tick(self._row, self._params, self.controls.motors, self._body, TICK_NS * 1e-9, SUBSTEPS)
            self._exchange()
        if not self._lagging and target - self._now_ns > 500_000_000:
            self._lagging = True
            self._notes.append("the firmware keeps no real time: it lags by more than 0.5 s")

    def _exchange(self) -> None:
        """Sensors of this tick out, the firmware's answer in."""
        if not self._admitted:
            self._admit()
            return
        time_us = BASE_US + self._now_ns // 1000
        messages = self.sensors.messages(time_us)
        if self._truth_ticks and self._ticks % self._truth_ticks == 0:
            force = tuple(self._row[state_row.F : state_row.F + 3].tolist())
            messages.insert(0, hil_state(self.sensors.packer, time_us, self.truth(), force))
        self._wire.send(b"".join(messages))  # one write: two would cost a fifth of the tick
        self._ticks += 1
        if self._wire.lockstep:
            self._await(time_us)
        else:
            self._take(self._wire.receive())

    def _await(self, time_us: int) -> None:
        """Until the answer to the tick of `time_us` is here, or the wire has waited in vain."""
        while self.controls.time_us < time_us:
            data = self._wire.receive()
            if not data:
                self.unanswered += 1
                self._silent += 1
                if self._silent > (_SILENT if self.controls.count else _MUTE):
                    word = "answers no more" if self.controls.count else "has joined and never answered"
                    raise FirmwareFault(f"the firmware {word}: see its log in the run's folder")
                return
            self._take(data)
        self._silent = 0
        if not self.controls.lockstep:
            raise FirmwareFault(
                "the firmware was built without lockstep, so that its clock is not ours: build px4_sitl_default"
            )

    def _take(self, data: list[bytes]) -> None:
        for piece in data:
            for frame in self._parser.feed(piece):
                if frame.name == "HIL_ACTUATOR_CONTROLS":
                    if not self.controls.count:
                        self._wire.mark_answered(True)
                    self.controls.receive(frame.fields)
                elif frame.name == "COMMAND_LONG" and frame.fields.command == Command.SET_MESSAGE_INTERVAL:
                    self._interval(frame.fields)

    def _interval(self, f: Any) -> None:
        if f.param1 == mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
            self._truth_ticks = max(_TRUTH, round(f.param2 * 1000.0 / TICK_NS)) if 0.0 < f.param2 < 1e9 else 0

    def _admit(self) -> None:
        """A flight controller gets sensors only once it is known to be in HITL mode and to measure no motors' battery.

        (With sensors it shows a battery of its own making.)"""
        for piece in self._wire.receive():
            for frame in self._parser.feed(piece):
                if frame.name == "SYS_STATUS":
                    self._check_battery(frame.fields.voltage_battery)
                elif frame.name == "HEARTBEAT" and frame.fields.autopilot == AUTOPILOT_PX4:
                    self._check_mode(frame.fields.base_mode)
        self._admitted = self._hitl and self._unpowered

    def _check_battery(self, millivolts: int) -> None:
        if 0 < millivolts < _NO_BATTERY and not self._powered:
            raise FirmwareFault(
                f"the flight controller measures a battery of {millivolts / 1000:.1f} V: disconnect it, "
                "or take the propellers off and set powered = true under [vehicle]"
            )
        self._unpowered = True

    def _check_mode(self, base_mode: int) -> None:
        if not base_mode & BaseMode.HIL:
            raise FirmwareFault(
                "the flight controller is not in HITL mode, so that it would drive real motors: set SYS_HITL to 1 and "
                "restart it"
            )
        self._hitl = True

    # -- truth, and acts of the world ---------------------------------------------------------------------------------

    def truth(self) -> Truth:
        """The vehicle's true state."""
        return truth_of(self._row, self.controls.armed, self._grip.holds)

    def take_notes(self) -> list[str]:
        """What was odd about the firmware since the last call."""
        notes, self._notes = self._notes + self.controls.take_faults(), []
        return notes

    def reboot(self) -> None:
        """The firmware restarts: the motors stop, and it boots where the vehicle is."""
        self._wire.restart()
        self._wire.mark_answered(False)
        self._parser, self.controls, self._silent = Parser(), MotorControls(), 0

    def set_wind(self, velocity: Vec3) -> None:
        """Velocity of the air (m/s, world) from now on."""
        self._row[state_row.WIND : state_row.WIND + 3] = velocity

    def attach(
        self,
        board_position: Vec3,
        board_orientation: Quat,
        stamp_ns: int,
        board_velocity: Vec3 = (0.0, 0.0, 0.0),
        board_turn_rate: float = 0.0,
    ) -> None:
        """The magnet holds: see `Grip.attach`. `stamp_ns`: when the board's pose is true, on `step`'s clock."""
        stamp = stamp_ns - (self._start_ns or 0)
        self._grip.attach(self._now_ns, stamp, board_position, board_orientation, board_velocity, board_turn_rate)
