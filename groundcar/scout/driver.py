"""The driver of the Scout Mini: the same code for the real car and the simulated one, on any CAN wire.

It requests CAN control once it receives the car's state, sends motion commands at 50 Hz while it gets fresh ones, and
sends nothing otherwise: a repeated old command would defeat the car's own 500 ms watchdog.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

from groundcar.scout.codec import V1_STATE_ID, Decoder, Frame, encode, feedback_names
from groundcar.scout.params import ScoutParams, load_scout

MODES = {0: "standby", 1: "can", 2: "uart", 3: "rc"}
WHEEL_BITS = ("under_voltage", "motor_hot", "over_current", "driver_hot", "can_lost")


class CanWire(Protocol):
    """A CAN bus: `receive` never blocks; frames are (can_id, data) pairs; `send` is False for a refused frame."""

    def send(self, frame: Any, /) -> bool | None: ...

    def receive(self) -> Iterable[tuple[int, bytes]]: ...


class Command(NamedTuple):
    """A command to the car and the time of its decision. Any object with these attributes is accepted."""

    stamp_ns: int
    speed: float  # m/s
    turn_rate: float  # rad/s, counter-clockwise positive


class Feedback(NamedTuple):
    """The car's last report. `stamp_ns` is the arrival of its last motion state, 0 before the first."""

    stamp_ns: int
    speed: float  # m/s, of the wheels
    turn_rate: float  # rad/s
    mode: str  # standby, can, uart, rc; empty before the first system state
    battery_v: float
    fault: str  # empty while healthy
    rejected_frames: int
    left_m: float  # rolled by the wheels of each side
    right_m: float
    sent_commands: int
    refused_commands: int  # stale, not finite, or from the future


class WrongProtocolError(RuntimeError):
    """The car uses protocol V1, which this driver does not support."""


class ScoutLink:
    """One car on one wire. Call `step` at 50 Hz or faster."""

    def __init__(self, wire: CanWire, params: ScoutParams | None = None) -> None:
        params = params or load_scout()
        self._wire, self._protocol, self._limits = wire, params.protocol, params.limits
        self._decoder = Decoder(feedback_names())
        self._received: dict[str, dict[str, float]] = {}
        self._received_ns: dict[str, int] = {}
        self._first_ns: int | None = None
        self._enable_ns: int | None = None
        self._motion_ns: int | None = None
        self._sent = self._refused = 0
        self._fault = self._mode = ""

    @property
    def ready(self) -> bool:
        """True while the car reports, grants CAN control and reports no fault."""
        return self._mode == "can" and not self._fault

    def step(self, now_ns: int, command: Any | None = None) -> Feedback:
        """Read the car's frames, then send what is due. `command`: a Command or its like, or None to send nothing.

        A command that is not finite, from the future or older than `command_max_age` is refused and counted. Raises
        WrongProtocolError if the car uses V1.
        """
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        for frame in self._wire.receive():
            self._receive(frame, now_ns)
        self._fault = self._judge(now_ns)
        self._mode = MODES.get(int(self._received.get("SystemState", {}).get("mode", -1)), "")
        if "MotionState" in self._received and self._mode in ("standby", "uart", ""):
            self._ask_for_control(now_ns)
        if command is not None and self._acceptable(command, now_ns) and self._mode == "can":
            self._command(command, now_ns)
        return self._feedback()

    def brake(self, lock: bool) -> None:
        """Lock or free the wheels (effective in CAN mode only)."""
        self._wire.send(encode("BrakeCommand", {"lock": lock}))

    def clear_errors(self, motor: int = 0) -> None:
        """Ask the car to clear its faults: of one motor (1 to 4), or all (0)."""
        self._wire.send(encode("ClearErrors", {"motor": motor}))

    def light(self, front: int) -> None:
        """Front light at `front` percent, under our control."""
        self._wire.send(encode("LightCommand", {"enable": 1, "front_mode": 3, "front": front}))

    def release(self) -> None:
        """Stop the car and hand control back: a motion command of zero, then standby."""
        self._wire.send(encode("MotionCommand", {}))
        self._wire.send(encode("ControlMode", {"mode": 0}))

    def _receive(self, frame: tuple[int, bytes], now_ns: int) -> None:
        if frame[0] == V1_STATE_ID:
            raise WrongProtocolError(
                "the car sends 0x151, so it speaks AgileX protocol V1; this driver speaks V2 only: "
                "update the car's firmware (V2 cars send 0x221), or check that this is the Scout's bus"
            )
        decoded = self._decoder.decode(frame)
        if decoded is not None:
            self._received[decoded[0]] = decoded[1]
            self._received_ns[decoded[0]] = now_ns

    def _judge(self, now_ns: int) -> str:
        faults = []
        silent_ns = round(self._protocol.silent_after * 1e9)
        if now_ns - self._received_ns.get("MotionState", self._first_ns or 0) > silent_ns:
            faults.append("silent: no motion state (0x221) on the bus")
        system = self._received.get("SystemState", {})
        if system.get("state") == 1:
            faults.append("e-stop pressed")
        if system.get("under_voltage"):
            faults.append("battery empty")
        for wheel in (1, 2, 3, 4):
            driver = self._received.get(f"Driver{wheel}", {})
            faults += [f"wheel {wheel} {bit.replace('_', ' ')}" for bit in WHEEL_BITS if driver.get(bit)]
        if system.get("state") == 2 and not faults:
            faults.append("fault of unknown cause")
        if system.get("mode") == 3:
            faults.append("remote control has taken over")
        return ", ".join(faults)

    def _ask_for_control(self, now_ns: int) -> None:
        period = round(self._protocol.enable_period * 1e9)
        if self._enable_ns is None or now_ns - self._enable_ns >= period:
            self._enable_ns = now_ns
            self._wire.send(encode("ControlMode", {"mode": 1}))

    def _acceptable(self, command: Any, now_ns: int) -> bool:
        age = now_ns - command.stamp_ns
        fresh = 0 <= age <= round(self._protocol.command_max_age * 1e9)
        if fresh and math.isfinite(command.speed) and math.isfinite(command.turn_rate):
            return True
        self._refused += 1
        return False

    def _command(self, command: Any, now_ns: int) -> None:
        period = round(self._protocol.command_period * 1e9)
        if self._motion_ns is not None and now_ns - self._motion_ns < period:
            return
        on_grid = self._motion_ns is not None and now_ns - self._motion_ns < 2 * period
        self._motion_ns = self._motion_ns + period if on_grid and self._motion_ns is not None else now_ns
        self._sent += self._wire.send(self._motion_frame(command)) is not False  # a refused frame was not sent

    def _motion_frame(self, command: Any) -> Frame:
        speed = min(max(command.speed, -self._limits.speed), self._limits.speed)
        turn = min(max(command.turn_rate, -self._limits.turn_rate), self._limits.turn_rate)
        return encode("MotionCommand", {"speed": speed, "turn_rate": turn})

    def _feedback(self) -> Feedback:
        motion, rolled = self._received.get("MotionState", {}), self._received.get("Odometry", {})
        return Feedback(
            stamp_ns=self._received_ns.get("MotionState", 0),
            speed=motion.get("speed", 0.0),
            turn_rate=motion.get("turn_rate", 0.0),
            mode=self._mode,
            battery_v=self._received.get("SystemState", {}).get("battery", 0.0),
            fault=self._fault,
            rejected_frames=self._decoder.rejected,
            left_m=rolled.get("left", 0.0),
            right_m=rolled.get("right", 0.0),
            sent_commands=self._sent,
            refused_commands=self._refused,
        )
