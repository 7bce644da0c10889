"""What all phases of the PX4 driver share: hearing, routine messages, requests with retries, failing, reporting."""

from __future__ import annotations

import math
from typing import Any

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Parser
from vehicle.px4.driver.heard import Heard
from vehicle.px4.driver.send import ByteWire, Sender
from vehicle.px4.driver.signing import is_signed
from vehicle.px4.driver.types import ExternalPose, LinkConfig, LinkOutput, Note

SECOND = 1_000_000_000
_SYNC_NS = 102_000_000  # no multiple of a simulator's tick, so that some questions meet it at its best
BEFORE_FLIGHT = ("connect", "parameters", "streams", "ready")


class LinkCore:
    """Base of `Px4Link`. `_t` is link time (see `LinkTime`); the clock given to `step` paces what is sent."""

    def __init__(self, wire: ByteWire, config: LinkConfig) -> None:
        self._wire, self._config = wire, config
        self._parser = Parser()
        self._send = Sender(wire, config)
        self._heard = Heard(config, self._send.timesync_answer)
        self.phase = "connect"
        self.refused = 0  # commands not sent: not finite, or not ours to send in this phase
        self._t = self._since = 0
        self._asked: int | None = None
        self._tries = self._acks_seen = 0
        self._beat_ns = self._sync_ns = self._pose_ns = -SECOND
        self._odometry_count = 0
        self._notes: list[Note] = []
        self._was = (False, False, 0)  # connected, failsafe, mode
        self._said_signed = False

    @property
    def armed(self) -> bool:
        """As the autopilot said last."""
        return self._heard.armed

    @property
    def garbage(self) -> int:
        """Bytes and frames on the wire that were not MAVLink."""
        return self._parser.garbage_bytes + self._parser.bad_frames

    @property
    def parameters(self) -> dict[str, float]:
        """PX4's parameters that matter here, as read before the flight."""
        return dict(self._heard.parameters.values)

    @property
    def counters(self) -> dict[str, int]:
        """What was rejected on the way, and how the clocks stand."""
        clock, signer = self._heard.clock, self._send.signer
        return {
            "garbage": self.garbage,
            "unknown_frames": self._parser.unknown_frames,
            "foreign_frames": self._heard.foreign,
            "unsigned_frames": signer.refused if signer else 0,
            "bad_odometry": self._heard.bad_odometry,
            "refused_commands": self.refused,
            "sent_frames": self._send.sent,
            "round_trip_ns": clock.round_trip_ns,
            "clock_offset_ns": clock.offset_ns or 0,
        }

    # hearing and routine

    def _listen(self, now_ns: int) -> None:
        heard, signer = self._heard, self._send.signer
        heard.begin()
        for data in self._wire.receive():
            for frame in self._parser.feed(data):
                if signer is None or signer.accepts(frame, now_ns):
                    heard.frame(frame, now_ns)
                if signer is None and is_signed(frame) and not self._said_signed:
                    self._said_signed = True
                    self._note("warning", "the autopilot signs what it sends, and this link has no key: it may be deaf")
        heard.texts.flush(now_ns)
        heard.time.advance(now_ns)
        self._t = heard.time.ns
        self._odometry_count += len(heard.fresh)
        if heard.rebooted:
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
        if pose is None or self._heard.heartbeat_ns is None:
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
        """True if nothing was asked yet, or the answer is overdue."""
        return self._asked is None or self._t - self._asked >= self._config.answer_limit * SECOND

    def _ask(self, complaint: str, command: int | None = None) -> bool:
        """True if a request is to be sent (again); after too many the link fails, if there is a `complaint`."""
        if not self._late():
            return False
        if self._tries >= self._config.tries:
            if complaint:
                self._fail(f"{complaint} after {self._tries} tries")
            return False
        self._tries += 1
        self._asked = self._t
        if command is not None:
            self._acks_seen = self._heard.acks.get(command, (0, 0))[1]
        return True

    def _new_ack(self, command: int) -> int | None:
        """The result of a command since it was last asked, None while there is none."""
        result, count = self._heard.acks.get(command, (0, 0))
        return result if count > self._acks_seen else None

    def _verdict(self, command: int) -> str:
        result, count = self._heard.acks.get(command, (0, 0))
        known: Any = px4.Result.__members__.values()
        return px4.Result(result).name if count and result in known else str(result) if count else "no answer"

    def _note(self, severity: str, text: str) -> None:
        self._notes.append(Note(severity, text))

    def _fail(self, why: str) -> None:
        self._enter("failed")
        self._note("error", why + self._heard.texts.quote())

    # reporting

    def _output(self, now_ns: int, sent: float | None, hover_thrust: float) -> LinkOutput:
        heard = self._heard
        connected, mode = heard.connected(now_ns), px4.mode_name(heard.mode)
        was_connected, was_failing, was_mode = self._was
        if was_connected and not connected:
            self._note("error", "link lost: no HEARTBEAT for 3 s")
        if heard.failsafe and not was_failing:
            self._note("error", f"autopilot in failsafe, mode {mode}")
        if heard.mode != was_mode:
            self._note("info", f"mode {mode}")
        self._was = (connected, heard.failsafe, heard.mode)
        return LinkOutput(
            phase=self.phase,
            connected=connected,
            armed=heard.armed,
            landed=not heard.in_air,
            failsafe=heard.failsafe,
            mode=mode,
            battery_v=heard.battery_v,
            hover_thrust=hover_thrust,
            odometry=heard.fresh,
            notes=[*heard.texts.take(), *heard.notes, *self._notes],
            sent_thrust=sent,
        )
