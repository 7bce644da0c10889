"""PX4's own log (ULog, docs.px4.io/main/en/dev_log/ulog_file_format.html): what the report needs of it, read by pyulog.

A damaged log gives what of it can be read, and says so in `faults`.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pyulog.core import ULog
from pyulog.px4_events import PX4Events

TOPICS = (
    "vehicle_angular_velocity", "vehicle_rates_setpoint", "actuator_motors", "control_allocator_status",
    "battery_status", "vehicle_imu_status", "estimator_innovation_test_ratios", "vehicle_local_position",
    "failsafe_flags", "vehicle_status", "event",
)  # fmt: skip
_HEADER, _MESSAGE_HEAD = 16, 3  # bytes
_LARGEST_FIELDS = 20_000  # numbers of one message, beyond which its format is not believed
_NUMBERS = frozenset(ULog._UNPACK_TYPES)  # types that are one number


class ULogError(ValueError):
    """The file is no log of PX4, or nothing in it can be read."""


@dataclass(frozen=True)
class LogTopic:
    """One topic's samples in order: `us` (n,) int64, PX4's time since boot; `fields` by name, (n,) each."""

    us: np.ndarray
    fields: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """A number over time, (n,) float64; NaN where this firmware's message has no such field."""
        found = self.fields.get(name)
        return np.full(len(self.us), np.nan) if found is None else found.astype(np.float64)

    def vector(self, name: str, length: int) -> np.ndarray:
        """An array field over time, (n, length) float64."""
        return np.column_stack([self[f"{name}[{i}]"] for i in range(length)])

    @property
    def hz(self) -> float:
        """Samples a second; 0 for a single one."""
        span = (self.us[-1] - self.us[0]) / 1e6
        return (len(self.us) - 1) / span if span > 0 else 0.0


@dataclass
class PX4Log:
    """One log. `not_default`: parameter -> (value, default) as PX4 itself compares them; `texts`: (us, level, text)."""

    path: Path
    topics: dict[str, LogTopic]
    span_us: tuple[int, int]
    firmware: str
    parameters: dict[str, float]
    not_default: dict[str, tuple[float, float]]
    changed: list[tuple[int, str, float]]
    texts: list[tuple[int, str, str]]
    dropouts: tuple[int, float]  # number, and seconds in all, in which PX4 could not write
    faults: list[str] = field(default_factory=list)


class _File(io.BytesIO):
    """A log that pyulog cannot read for ever: it steps back in front of a damaged message, at the end further than it
    has read, and then meets the same message again."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left, self._began, self._short = 4 * len(data) + 1_000_000, 0, False

    def read(self, size: int | None = -1, /) -> bytes:
        """Raises EOFError if far more was read than there is."""
        if size == _MESSAGE_HEAD:
            self._began = self.tell()
        data = super().read(size)
        self._short = size is not None and len(data) < size
        self._left -= max(1, len(data))
        if self._left < 0:
            raise EOFError
        return data

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """A step back ends at the newest message's beginning, behind it if its end is missing."""
        if whence == io.SEEK_CUR and offset < 0:
            offset, whence = max(self.tell() + offset, self._began + self._short), io.SEEK_SET
        return super().seek(offset, whence)


def read_ulog(path: Path) -> PX4Log:
    """Read a log. Raises ULogError for a file that is none or holds nothing that can be read, OSError."""
    data = path.read_bytes()
    if data[:7] != ULog.HEADER_BYTES:
        raise ULogError(f"{path}: is no log of PX4 (.ulg): its first bytes are not those of a ULog")
    data, faults = _believable(data)
    log = _parsed(data, faults)
    if log is None or not (log.data_list or log.initial_parameters):
        raise ULogError(f"{path}: holds nothing that can be read{f' ({faults[0]})' if faults else ''}")
    faults += _end(data)
    if log.file_corruption:
        faults.append("it is damaged inside: the messages that could not be read are missing")
    topics = dict(_topics(log, faults))
    spans = [(int(topic.us[0]), int(topic.us[-1])) for topic in topics.values()]
    spans = spans or [(int(log.start_timestamp), int(log.start_timestamp))]
    span = (min(a for a, _ in spans), max(b for _, b in spans))
    values = {name: float(v) for name, v in log.initial_parameters.items() if isinstance(v, int | float)}
    defaults = {**log.get_default_parameters(0), **log.get_default_parameters(1)}
    different = {name: (values[name], float(v)) for name, v in defaults.items() if name in values and _number(v)}
    changed = [(int(t), str(name), float(v)) for t, name, v in log.changed_parameters if _number(v)]
    lost_s = sum(one.duration for one in log.dropouts) / 1e3
    return PX4Log(
        path, topics, span, _firmware(log), values, different, changed, sorted(_texts(log, faults)),
        (len(log.dropouts), lost_s), faults,
    )  # fmt: skip


def _number(value: object) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))


def _parsed(data: bytes, faults: list[str]) -> ULog | None:
    """The log, or what stands before the place at which pyulog fails; None if that is nothing."""
    for whole in (True, False):
        file = _File(data)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks of a damaged file
                return ULog(file, list(TOPICS))
        except Exception as error:  # of whatever kind: the bytes may be anything
            at = len(data) if file.closed else file.tell()
            faults.append(f"it cannot be read beyond byte {at} of {len(data)} ({type(error).__name__})")
            data = data[: max(_HEADER, at - 1)] if whole else data
    return None


def _believable(data: bytes) -> tuple[bytes, list[str]]:
    """`data` without formats of messages that a damaged file makes endless: pyulog unrolls each array and nesting."""
    formats: dict[str, list[tuple[int, str]]] = {}
    places = []
    for at, kind, payload in _messages(data):
        if kind not in b"BFIMPQ":
            break  # the definitions are over
        if kind == ord("F"):
            name, _, fields = payload.decode("utf-8", "ignore").partition(":")
            formats[name] = [
                (int(count or 1), what) for what, count in re.findall(r"([\w/]+)(?:\[(\d+)\])? \w+", fields)
            ]
            places.append((at, len(payload) + 3, name))
    bad = [(at, size, name) for at, size, name in places if _fields(name, formats, 0) > _LARGEST_FIELDS]
    for at, size, _ in reversed(bad):
        data = data[:at] + data[at + size :]
    return data, [f"the format of the message {name[:40]!r} is damaged" for _, _, name in bad]


def _fields(name: str, formats: dict[str, list[tuple[int, str]]], depth: int) -> int:
    """How many numbers a message holds; more than `_LARGEST_FIELDS` if it is not to be believed."""
    if depth > 8:
        return _LARGEST_FIELDS + 1
    total = 0
    for count, what in formats.get(name, ()):
        total += count * (1 if what in _NUMBERS else _fields(what, formats, depth + 1))
        if total > _LARGEST_FIELDS:
            break
    return total


def _messages(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """(place, kind, payload) of each message as long as they follow one another."""
    at = _HEADER
    while at + _MESSAGE_HEAD <= len(data):
        size, kind = struct.unpack_from("<HB", data, at)
        if at + 3 + size > len(data):
            return
        yield at, kind, data[at + 3 : at + 3 + size]
        at += 3 + size


def _end(data: bytes) -> list[str]:
    """Whether the log ends in the middle of a message, as one does whose writer lost its power."""
    end = _HEADER
    for at, kind, payload in _messages(data):
        if kind not in b"BFIMPQADLCSOR":
            return []  # damaged inside: what follows is not followed here
        end = at + 3 + len(payload)
    return [f"it is cut off: its last message lacks its end (byte {end} of {len(data)})"] if end < len(data) else []


def _topics(log: ULog, faults: list[str]) -> Iterator[tuple[str, LogTopic]]:
    """The first instance of each topic; samples whose time runs backwards are left out."""
    for one in log.data_list:
        if any(other.name == one.name and other.multi_id < one.multi_id for other in log.data_list):
            continue
        if "timestamp" not in one.data:
            faults.append(f"{one.name} has no time stamps")
            continue
        us = one.data["timestamp"].astype(np.int64)
        good = (us > 0) & (us == np.maximum.accumulate(us)) & (us - us[0] < 10 * 86_400_000_000)
        good[1:] &= np.diff(us) > 0
        if good.any():
            yield one.name, LogTopic(us[good], {name: column[good] for name, column in one.data.items()})


def _texts(log: ULog, faults: list[str]) -> Iterator[tuple[int, str, str]]:
    """Texts and events of PX4; an event in the words of the metadata that the log itself carries."""
    for message in log.logged_messages:
        yield int(message.timestamp), message.log_level_str().lower(), message.message.strip()
    reader = PX4Events()
    reader.set_default_json_definitions_cb(lambda _: None)  # nothing is fetched from the network
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            events = reader.get_logged_events(log)
    except Exception as error:  # the metadata may be damaged in any way
        faults.append(f"its events cannot be read ({type(error).__name__})")
        return
    for us, level, text in events:
        yield int(us), level.lower(), text.strip()


def _firmware(log: ULog) -> str:
    """Release and commit, as the log says."""
    version = log.get_version_info()
    release = ".".join(map(str, version[:3])) if version else "of unknown release"
    commit = str(log.msg_info_dict.get("ver_sw", ""))[:10]
    return f"PX4 {release}{f' ({commit})' if commit else ''}"
