"""PX4's parameters before a flight: read the relevant ones, set the configured ones, judge the rest and advise."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Mapping

from vehicle.px4.driver.types import LinkConfig, Note

INT32, REAL32 = 6, 9  # MAV_PARAM_TYPE
SET = struct.Struct("<4sBB16sB")  # PARAM_SET as it lies on the wire
READ = struct.Struct("<hBB16s")  # PARAM_REQUEST_READ
VALUE = struct.Struct("<4sHH16sB")  # PARAM_VALUE
_FLIGHT_TERMINATION_OFF = 121212
_ROOM_DEG = 10.0  # margin of the failure detector above the steepest attitude
_JUDGED = (
    *("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "CBRK_FLIGHTTERM", "FD_FAIL_P", "FD_FAIL_R", "MPC_THR_HOVER"),
    *("EKF2_EV_CTRL", "EKF2_HGT_REF", "SYS_HAS_MAG", "EKF2_MAG_TYPE", "EKF2_EV_DELAY"),
)


def pack_value(value: float, kind: int) -> bytes:
    """The four bytes of a parameter: PX4 puts an INT32 bytewise into the float field."""
    return struct.pack("<i", int(value)) if kind == INT32 else struct.pack("<f", value)


def unpack_value(four: bytes, kind: int) -> float | None:
    """The number in those bytes, None for a type that PX4 does not use."""
    if kind == INT32:
        return struct.unpack("<i", four)[0]
    return struct.unpack("<f", four)[0] if kind == REAL32 else None


def read_value(payload: bytes) -> tuple[str, float | None, int]:
    """(name, value, type) in a PARAM_VALUE's payload; the value is None for a type that PX4 does not use."""
    four, _, _, raw, kind = VALUE.unpack(payload[: VALUE.size].ljust(VALUE.size, b"\0"))
    return raw.split(b"\0", 1)[0].decode("ascii", "replace"), unpack_value(four, kind), kind


def judge(values: Mapping[str, float], config: LinkConfig) -> list[str]:
    """What is wrong in `values` (name: value) for perching flights, each with advice; empty if nothing is."""
    faults: list[str] = []

    def value(name: str) -> float:
        return values.get(name, math.nan)

    if value("COM_OF_LOSS_T") > 0.5:
        faults.append(
            f"COM_OF_LOSS_T is {value('COM_OF_LOSS_T'):g} s: the vehicle flies on that long after the last command; "
            "0.2 to 0.3 s is advisable"
        )
    if config.gap_limit > value("COM_OF_LOSS_T"):
        faults.append(
            f"the driver waits {config.gap_limit:g} s for a late command, longer than COM_OF_LOSS_T "
            f"({value('COM_OF_LOSS_T'):g} s): set gap_limit below it"
        )
    if value("COM_OBL_RC_ACT") not in (4, 5) and "COM_OBL_RC_ACT" in values:
        faults.append(
            f"COM_OBL_RC_ACT is {value('COM_OBL_RC_ACT'):g}: without RC a lost command stream ends in a return flight; "
            "4 (land) or 5 (hold) stays where it is"
        )
    steepest = math.degrees(config.steepest)
    tight = [name for name in ("FD_FAIL_P", "FD_FAIL_R") if 0 < value(name) < steepest + _ROOM_DEG]
    if tight and value("CBRK_FLIGHTTERM") != _FLIGHT_TERMINATION_OFF:
        limits = ", ".join(f"{name} {value(name):g}" for name in tight)
        faults.append(
            f"{limits} deg: a perch at {steepest:.0f} deg tilts as far, and PX4 then stops the motors in the air; "
            f"raise them to {steepest + _ROOM_DEG:.0f} or more, or set CBRK_FLIGHTTERM {_FLIGHT_TERMINATION_OFF}"
        )
    hover = value("MPC_THR_HOVER")
    if abs(hover / config.hover_thrust - 1.0) > 0.2:
        faults.append(
            f"MPC_THR_HOVER is {hover:.3f}, the airframe file gives {config.hover_thrust:.3f}: "
            "the hover starts with a drop or a jump until PX4 has learned it"
        )
    if config.external_vision:
        faults += _judge_vision(value)
    return faults


def _judge_vision(value: Callable[[str], float]) -> list[str]:
    faults: list[str] = []
    control = value("EKF2_EV_CTRL")
    if math.isnan(control) or int(control) & 11 != 11:
        faults.append(f"EKF2_EV_CTRL is {control:g}: 11 or 15 lets PX4 use external position, height and yaw")
    if value("EKF2_HGT_REF") != 3:
        faults.append(f"EKF2_HGT_REF is {value('EKF2_HGT_REF'):g}: 3 takes height from vision; set it, then reboot PX4")
    if value("SYS_HAS_MAG") != 0 or value("EKF2_MAG_TYPE") != 5:
        faults.append(
            f"SYS_HAS_MAG is {value('SYS_HAS_MAG'):g} and EKF2_MAG_TYPE {value('EKF2_MAG_TYPE'):g}: near the magnet "
            "and a steel board use 0 and 5, and take yaw from motion capture"
        )
    return faults


class ParameterCheck:
    """Reads, sets and reads back. `requests`: what to send; `receive` takes each PARAM_VALUE; `done` at the end."""

    def __init__(self, config: LinkConfig) -> None:
        self._config = config
        self._names = list(dict.fromkeys((*config.parameters, *_JUDGED)))
        self.values: dict[str, float] = {}
        self._kinds: dict[str, int] = {}
        self._unknown: list[str] = []
        self._before: dict[str, float] = {}
        self._stale: set[str] = set()

    def read_again(self, names: Iterable[str]) -> None:
        """Ask for these anew, whatever was answered before."""
        self._stale = set(names)
        self._names += sorted(self._stale.difference(self._names))
        self._unknown = [name for name in self._unknown if name not in self._stale]

    @property
    def unread(self) -> list[str]:
        """Names not answered yet, or to be read again."""
        owed = (name for name in self._names if name not in self.values or name in self._stale)
        return [name for name in owed if name not in self._unknown]

    @property
    def unset(self) -> list[str]:
        """Names whose value in PX4 differs from the configured one."""
        asked = self._config.parameters.items()
        return [name for name, value in asked if name not in self._unknown and not self._holds(name, value)]

    @property
    def done(self) -> bool:
        """True once all are read and as configured."""
        return not self.unread and not self.unset

    def requests(self) -> list[tuple[str, bytes]]:
        """(message name, payload) of the requests still open; send them again if they are not answered."""
        target = (self._config.system, self._config.component)
        if self.unread:
            return [("PARAM_REQUEST_READ", READ.pack(-1, *target, name.encode())) for name in self.unread]
        owed = []
        for name in self.unset:
            kind = self._kinds[name]
            four = pack_value(self._config.parameters[name], kind)
            owed.append(("PARAM_SET", SET.pack(four, *target, name.encode(), kind)))
        return owed

    def receive(self, payload: bytes) -> None:
        """A PARAM_VALUE's payload."""
        name, value, kind = read_value(payload)
        if value is not None and name in self._names:
            self._stale.discard(name)
            self._before.setdefault(name, value)
            self.values[name], self._kinds[name] = value, kind

    def give_up_reading(self) -> str:
        """Some names are not answered: continue without them. Returns the reason if that is not allowed."""
        self._unknown += self.unread
        if not self.values:
            return "the autopilot answers no request for a parameter"
        missing = [name for name in self._config.required if name in self._unknown]
        if missing:
            return (
                f"this PX4 has no parameter {' nor '.join(missing)}, or does not answer: what it does when commands "
                "stop is not known, so it is not armed: check firmware and link"
            )
        return ""

    def report(self) -> list[Note]:
        """What was changed, what is unknown, what is wrong."""
        notes = [
            Note("info", f"{name} set to {self.values[name]:g} (was {self._before[name]:g})")
            for name in self._config.parameters
            if name not in self._unknown and self._before[name] != self.values[name]
        ]
        for name in self._unknown:
            undone = "not set" if name in self._config.parameters else "not checked"
            notes.append(Note("warning", f"this PX4 has no parameter {name}, or does not answer: {undone}"))
        return notes + [Note("warning", text) for text in judge(self.values, self._config)]

    def _holds(self, name: str, wanted: float) -> bool:
        held = self.values.get(name)
        return held is not None and abs(held - wanted) <= 1e-6 * max(1.0, abs(wanted))
