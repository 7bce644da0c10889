"""The autopilot on the ground station's link, by MAVSDK: health, why it does not arm, parameters, reboot, logs.

It never arms, and changes nothing on an armed vehicle. The driver's own link is another one (`vehicle/px4/driver`).
"""

from __future__ import annotations

import glob
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.events import Events, EventsError
from mavsdk.plugins.log_files import LogFiles, LogFilesError, LogFilesResult
from mavsdk.plugins.mavlink_direct import MavlinkDirectError
from mavsdk.plugins.param import Param, ParamError, ParamResult
from mavsdk.plugins.telemetry import Telemetry

from hil.bench.ground_health import CHECKS, Health, Problem
from hil.bench.log_transfer import LogTransfer
from hil.bench.reading import Unavailable
from hil.wires import WireError
from hil.wires.url import check_url

_FIND_S = 10.0  # for an autopilot on the link
_HEALTH_S, _EVENTS_S = 8.0, 4.0  # for its checks to pass, and for the texts of its events to be fetched
_BEAT_S = 1.5  # PX4 says once a second that it is there
_ARMED_S, _STALLED_S, _PAUSE_S = 20.0, 20.0, 0.1
_TRIES = 2  # of MAVSDK's own three seconds
_SCHEMES = {"udpin": "udpin://{}:{}", "udpout": "udpout://{}:{}", "tcp": "tcpout://{}:{}", "serial": "serial://{}:{}"}
_IN_USE = mavsdk.ConnectionResult.BIND_ERROR


class Refused(Exception):
    """The autopilot answers, and does not do it."""


class LogEntry(NamedTuple):
    """One log on the autopilot."""

    id: int
    utc: str
    size: int


class GroundStation:
    """One connection. Use it as a context; its methods raise Unavailable if the autopilot does not answer."""

    def __init__(self, url: str, system: int = 0, wait_s: float | None = None) -> None:
        """Connect to `url` (as a rig writes it), and wait for an autopilot, 10 s if not told.

        `system`: its MAV_SYS_ID; 0: the only one that is heard. Raises Unavailable.
        """
        wait_s = _FIND_S if wait_s is None else wait_s
        try:
            kind, where, number = check_url(url)
        except WireError as error:
            raise Unavailable(str(error)) from None
        mavsdk.log_subscribe(lambda *_: True)  # it prints on stdout otherwise
        self._url = url
        component = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
        self._client = mavsdk.Mavsdk(component)
        self._texts: list[str] = []
        try:
            result = self._client.add_any_connection(_SCHEMES[kind].format(where, number))
            if result != mavsdk.ConnectionResult.SUCCESS:
                why = "is in use: QGroundControl or another program listens there" if result == _IN_USE else result.name
                raise Unavailable(f"{url}: {why}")
            found = self._find(system, wait_s)
            self._found, self._telemetry, self._action = found, Telemetry(found), Action(found)
            self._events, self._param, self._logs = Events(found), Param(found), LogFiles(found)
            self._telemetry.subscribe_status_text(lambda text, _: self._texts.append(text.text.strip()))
        except BaseException:
            self._client.destroy()
            raise

    def _find(self, system: int, wait_s: float) -> mavsdk.System:
        """The autopilot. Several PX4s send to one ground station: which of them is meant has then to be said."""
        until = time.monotonic() + wait_s
        if self._client.first_autopilot(wait_s) is not None:
            time.sleep(_BEAT_S)
        while True:
            heard = {one.get_system_id(): one for one in self._client.get_systems() if one.has_autopilot()}
            if system in heard:
                return heard[system]
            if system == 0 and len(heard) == 1:
                return next(iter(heard.values()))
            names = ", ".join(map(str, sorted(heard)))
            if system == 0 and heard:
                raise Unavailable(f"{self._url}: several autopilots (systems {names}): name one by --system")
            if time.monotonic() > until:
                which = f" with MAV_SYS_ID {system}" if system else ""
                others = f" (heard: {names})" if heard else ""
                raise Unavailable(f"{self._url}: no autopilot{which} within {wait_s:g} s{others}")
            time.sleep(_PAUSE_S)

    def __enter__(self) -> GroundStation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; may be called twice."""
        self._client.destroy()

    # -- health ---------------------------------------------------------------------------------------------------

    def health(self, wait_s: float = _HEALTH_S) -> Health:
        """Its own checks; waits up to `wait_s` for them to pass, and for the report of its events."""
        began, report = time.monotonic(), None
        while True:
            told = self._telemetry.health()
            report = report or self._report()
            passed = time.monotonic() - began
            if passed > wait_s or (told.is_armable and (report is not None or passed > _EVENTS_S)):
                break
            time.sleep(_PAUSE_S)
        report = self._report() or report
        problems = [] if report is None else [_problem(one) for one in report.current_mode_intention.problems]
        checks = {name: bool(getattr(told, field)) for name, field in CHECKS.items()}
        return Health(checks, problems, list(self._texts), report is not None)

    def _report(self) -> Any:
        """PX4's report of its health and arming checks; None without the metadata of its events."""
        try:
            return self._events.get_health_and_arming_checks_report()
        except EventsError:
            return None

    def _need_disarmed(self) -> None:
        """Raises Refused if it is armed, Unavailable if it does not tell."""
        told: list[bool] = []
        handle = self._telemetry.subscribe_armed(lambda armed, _: told.append(armed))
        until = time.monotonic() + _ARMED_S
        while not told and time.monotonic() < until:
            time.sleep(_PAUSE_S)
        self._telemetry.unsubscribe_armed(handle)
        if not told:
            raise Unavailable(f"{self._url}: the autopilot does not tell whether it is armed")
        if told[-1]:
            raise Refused("the vehicle is armed: disarm it first")

    # -- parameters, reboot ---------------------------------------------------------------------------------------

    def parameter(self, name: str) -> int | float:
        """The value that it holds. Raises Refused for a parameter that it does not know."""
        kinds = [self._param.get_param_int, self._param.get_param_float]
        result = ParamResult.UNKNOWN
        for _ in range(_TRIES):
            for read in tuple(kinds):
                try:
                    return read(name)
                except ParamError as error:
                    result = error.result
                if result != ParamResult.WRONG_TYPE:
                    break
                kinds.remove(read)
        known = "perhaps it has no such parameter"
        raise Refused(f"the autopilot does not tell {name} ({_words(result)}): {known}")

    def set_parameter(self, name: str, value: float) -> tuple[int | float, int | float]:
        """Set it on a disarmed vehicle; the values before and after, as the autopilot holds them. Raises Refused."""
        self._need_disarmed()
        before = self.parameter(name)
        if isinstance(before, int) and value != int(value):
            raise Refused(f"{name} is a whole number, {value:g} is none")
        try:
            if isinstance(before, int):
                self._param.set_param_int(name, int(value))
            else:
                self._param.set_param_float(name, value)
        except ParamError as error:
            raise Refused(f"{name} was not set: {_words(error.result)}") from None
        return before, self.parameter(name)

    def reboot(self) -> None:
        """Restart a disarmed autopilot. Raises Refused."""
        self._need_disarmed()
        try:
            self._action.reboot()
        except ActionError as error:
            raise Refused(f"it does not reboot: {_words(error.result)}") from None

    # -- logs -----------------------------------------------------------------------------------------------------

    def logs(self) -> list[LogEntry]:
        """Its logs, the oldest first."""
        try:
            entries = self._logs.get_entries()
        except LogFilesError as error:
            if error.result == LogFilesResult.NO_LOGFILES:
                return []
            raise Unavailable(f"{self._url}: the list of its logs did not come ({_words(error.result)})") from None
        return sorted(LogEntry(int(one.id), str(one.date), int(one.size_bytes)) for one in entries)

    def download(self, log: LogEntry, path: Path, progress: Callable[[float], None] = lambda _: None) -> None:
        """Write a log of the latest `logs` to `path`, which appears when it is whole.

        `progress` is told the share that has come. What an earlier call left of the same log beside `path` is not
        fetched again. Raises Unavailable if the log does not come whole, OSError if it cannot be written. What
        `progress` raises ends it.
        """
        utc = "".join(filter(str.isalnum, log.utc))
        part = path.with_name(f".{path.name}.{log.id}-{log.size}-{utc}.part")
        for other in set(path.parent.glob(f".{glob.escape(path.name)}.*.part")) - {part}:
            other.unlink()
        try:
            with LogTransfer(self._found) as transfer:
                transfer.fetch(log.id, log.size, part, _STALLED_S, progress)
        except MavlinkDirectError as error:
            raise Unavailable(f"log {log.id}: {_words(error.result)}") from None
        finally:
            if log.size and part.exists() and not part.stat().st_size:
                part.unlink()
        part.replace(path)


def _problem(one: Any) -> Problem:
    text = " ".join(one.message.split())
    return Problem(text, " ".join(one.description.split()), one.log_level.name.lower(), one.health_component)


def _words(result: Any) -> str:
    return result.name.lower().replace("_", " ")
