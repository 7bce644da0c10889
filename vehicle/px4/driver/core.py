"""What all phases of the PX4 driver share: receiving, routine messages, requests with retries, failure, report."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Frame, Parser
from vehicle.px4.driver.arming import Identity
from vehicle.px4.driver.autopilot import Autopilot
from vehicle.px4.driver.params import READ
from vehicle.px4.driver.resets import ResetNotes
from vehicle.px4.driver.send import ByteWire, Sender
from vehicle.px4.driver.signing import is_signed
from vehicle.px4.driver.types import ExternalPose, LinkConfig, LinkOutput, Note

SECOND = 1_000_000_000
_SYNC_NS = 102_000_000  # no multiple of a simulator's tick, so that some requests have a short round trip
BEFORE_FLIGHT = ("connect", "parameters", "streams", "ready", "verify")
_HOVERING = ("hover", "handed_over")
_AUTOPILOT_VERSION = 148


class LinkCore:
    """Base of `Px4Link`. `_t` is link time (see `LinkTime`); the clock given to `step` sets sending rates."""

    def __init__(self, wire: ByteWire, config: LinkConfig, listen: Callable[[Frame], None] | None = None) -> None:
        """`listen` is called with each frame that is accepted as the autopilot's."""
        self._wire, self._config, self._listen = wire, config, listen
        self._parser = Parser()
        self._send = Sender(wire, config)
        self._autopilot = Autopilot(config, self._send.timesync_answer)
        self.phase = "connect"
        self.refused = 0  # commands that were not sent: not finite, or not allowed in this phase
        self._t = self._since = 0
        self._asked: int | None = None
        self._tries = self._acks_seen = 0
        self._beat_ns = self._sync_ns = self._pose_ns = -SECOND
        self._odometry_count = 0
        self._notes: list[Note] = []
        self._resets = ResetNotes()
        self._was = (False, False, 0)  # connected, failsafe, mode
        self._reported_signed = False

    @property
    def armed(self) -> bool:
        """The autopilot's last report."""
        return self._autopilot.armed

    @property
    def garbage(self) -> int:
        """Bytes and frames on the wire that were not MAVLink."""
        return self._parser.garbage_bytes + self._parser.bad_frames

    @property
    def parameters(self) -> dict[str, float]:
        """PX4's parameters that matter here, as read before the flight."""
        return dict(self._autopilot.parameters.values)

    @property
    def identity(self) -> Identity | None:
        """Which autopilot it is, as last told; None while it has not answered `ask_identity`."""
        return self._autopilot.identity

    def ask_identity(self) -> None:
        """Request AUTOPILOT_VERSION once."""
        self._send.command(px4.Command.REQUEST_MESSAGE, float(_AUTOPILOT_VERSION))

    def ask_parameter(self, name: str) -> None:
        """Request the value of one parameter once."""
        payload = READ.pack(-1, self._config.system, self._config.component, name.encode())
        self._send.payload("PARAM_REQUEST_READ", payload)

    @property
    def counters(self) -> dict[str, int]:
        """Counts of rejected input, and the clock offset."""
        clock, signer = self._autopilot.clock, self._send.signer
        return {
            "garbage": self.garbage,
            "unknown_frames": self._parser.unknown_frames,
            "foreign_frames": self._autopilot.foreign,
            "unsigned_frames": signer.refused if signer else 0,
            "bad_odometry": self._autopilot.bad_odometry,
            "refused_commands": self.refused,
            "sent_frames": self._send.sent,
            "round_trip_ns": clock.round_trip_ns,
            "clock_offset_ns": clock.offset_ns or 0,
        }

    # receiving and routine messages

    def _receive(self, now_ns: int) -> None:
        autopilot, signer = self._autopilot, self._send.signer
        autopilot.begin()
        for data in self._wire.receive():
            for frame in self._parser.feed(data):
                accepted = signer is None or signer.accepts(frame, now_ns)
                if accepted and autopilot.frame(frame, now_ns) and self._listen is not None:
                    self._listen(frame)
                if signer is None and is_signed(frame) and not self._reported_signed:
                    self._reported_signed = True
                    self._note(
                        "warning",
                        "the autopilot signs its messages and this link has no key: it may ignore unsigned commands",
                    )
        autopilot.texts.flush(now_ns)
        autopilot.time.advance(now_ns)
        self._t = autopilot.time.ns
        self._odometry_count += len(autopilot.fresh)
        self._notes += self._resets.take(now_ns, autopilot.resets, hovering=self.phase in _HOVERING)
        if autopilot.rebooted:
            self._note("error", "the autopilot has rebooted")
            if self.phase in BEFORE_FLIGHT:
                self._enter("connect")
            else:
                self._fail("the autopilot rebooted in flight")

    def _routine(self, now_ns: int, pose: ExternalPose | None) -> None:
        if now_ns - self._beat_ns >= SECOND:
            self._beat_ns = now_ns
            self._send.heartbeat()
        if now_ns - self._sync_ns >= _SYNC_NS:
            self._sync_ns = now_ns
            self._send.timesync_request()
        if pose is None or self._autopilot.heartbeat_ns is None:
            return
        due = pose.stamp_ns - self._pose_ns >= 0.95e9 / self._config.external_pose_hz
        if due and all(map(math.isfinite, (*pose.position, *pose.orientation))):
            self._pose_ns = pose.stamp_ns
            self._send.external_pose(pose)

    # phases and requests

    def _enter(self, phase: str) -> None:
        self.phase, self._since, self._tries, self._asked = phase, self._t, 0, None

    def _elapsed(self, seconds: float) -> bool:
        """True once the phase has lasted that long."""
        return self._t - self._since > seconds * SECOND

    def _late(self) -> bool:
        """True if no request was sent yet, or its answer is overdue."""
        return self._asked is None or self._t - self._asked >= self._config.answer_limit * SECOND

    def _ask(self, complaint: str, command: int | None = None) -> bool:
        """True if a request is to be sent (again); after `tries` of them the link fails with `complaint`, if given."""
        if not self._late():
            return False
        if self._tries >= self._config.tries:
            if complaint:
                self._fail(f"{complaint} after {self._tries} tries")
            return False
        self._tries += 1
        self._asked = self._t
        if command is not None:
            self._acks_seen = self._autopilot.acks.get(command, (0, 0))[1]
        return True

    def _new_ack(self, command: int) -> int | None:
        """The result of a command since its last request, None while there is none."""
        result, count = self._autopilot.acks.get(command, (0, 0))
        return result if count > self._acks_seen else None

    def _result_name(self, command: int) -> str:
        result, count = self._autopilot.acks.get(command, (0, 0))
        known: Any = px4.Result.__members__.values()
        return px4.Result(result).name if count and result in known else str(result) if count else "no answer"

    def _note(self, severity: str, text: str) -> None:
        self._notes.append(Note(severity, text))

    def _fail(self, why: str) -> None:
        self._enter("failed")
        self._note("error", why + self._autopilot.texts.quote())

    # reporting

    def _output(self, now_ns: int, sent: float | None, hover_thrust: float) -> LinkOutput:
        autopilot = self._autopilot
        connected, mode = autopilot.connected(now_ns), px4.mode_name(autopilot.mode)
        was_connected, was_failing, was_mode = self._was
        if was_connected and not connected:
            self._note("error", "link lost: no HEARTBEAT for 3 s")
        if autopilot.failsafe and not was_failing:
            self._note("error", f"autopilot in failsafe, mode {mode}")
        if autopilot.mode != was_mode:
            self._note("info", f"mode {mode}")
        self._was = (connected, autopilot.failsafe, autopilot.mode)
        return LinkOutput(
            phase=self.phase,
            connected=connected,
            armed=autopilot.armed,
            landed=not autopilot.in_air,
            failsafe=autopilot.failsafe,
            mode=mode,
            battery_v=autopilot.battery_v,
            hover_thrust=hover_thrust,
            odometry=autopilot.fresh,
            notes=[*autopilot.texts.take(), *self._notes],
            sent_thrust=sent,
            clock_offset_ns=autopilot.clock.offset_ns,
        )
