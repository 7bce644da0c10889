"""The autopilot's own log of a flight that has ended, fetched into the run's folder, where its report finds it."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from pathlib import Path

from hil.assembly.rig import VehicleSlot
from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PREFIX

LOG = "autopilot.ulg"
_STATUS = "vehicle/status"
_DRIVER = "vehicle_link"  # the service that has the offboard link
_JUDGED_S = 5.0  # of a download, before its speed is believed
_GROWING_S, _LOOKS = 0.5, 6  # PX4 closes its log a moment after disarming


class _TooSlow(Exception):
    """The link would need longer than the rig allows; says how long."""


def log_link(slot: VehicleSlot, remote: Collection[str]) -> str:
    """The link over which the autopilot gives its log after a live flight; empty if none is to be fetched.

    The ground station's if the rig has one, else the offboard link, which the driver has closed by then. `remote`: the
    services of other hosts. A signed link is left out: MAVSDK does not sign.
    """
    if slot.kind not in ("mavlink", "hitl") or slot.log_limit_s == 0.0 or slot.signing_key:
        return ""
    return slot.ground_url or ("" if _DRIVER in remote else slot.url)


def fetch_log(
    link: str, slot: VehicleSlot, folder: Path, recording: Path, progress: Callable[[float], None] = lambda _: None
) -> str:
    """Fetch the newest log into the run's `folder`; the line that says what came of it, empty if nothing was to do.

    A flight without arming has no log, and a log (.ulg) that is in the folder is kept. No failure is raised: the
    flight is over, and its verdict stands. `progress` is told the share that has come.
    """
    armed = _armed(recording)
    if not armed or any(folder.glob("*.ulg")):
        return ""
    later = f"later: perch-hil vehicle log {folder} --link {link} --system {slot.system}"
    if armed[-1]:
        return f"the autopilot's log is not fetched, because it is still armed; {later}"
    try:
        size = _fetch(link, slot, folder / LOG, progress)
    except Exception as error:  # whatever it is, also MAVSDK's own: see above
        text = str(error) or type(error).__name__
        return f"the autopilot's log is not fetched: {text}; {later}"
    return f"the autopilot's log: {folder / LOG} ({size / 1e6:.2f} MB)"


def _fetch(link: str, slot: VehicleSlot, path: Path, progress: Callable[[float], None]) -> int:
    """Fetch it; its bytes. Raises Unavailable, Refused, OSError, _TooSlow."""
    from hil.bench.ground import GroundStation, Refused

    with GroundStation(link, slot.system) as station:
        logs = station.logs()
        for _ in range(_LOOKS):
            before = logs
            time.sleep(_GROWING_S)
            logs = station.logs()
            if logs[-1:] == before[-1:]:
                break
        if not logs:
            raise Refused("it has none")
        began = time.monotonic()

        def watched(share: float) -> None:
            progress(share)
            passed = time.monotonic() - began
            whole = passed / max(share, 1e-6) if passed > _JUDGED_S else 0.0
            if share < 1.0 and max(passed, whole) > slot.log_limit_s:
                size, need = logs[-1].size / 1e6, f"{whole / 60:.0f} min" if share > 0.0 else "too long"
                raise _TooSlow(f"{size:.1f} MB need {need} on this link (log_limit_s = {slot.log_limit_s:g})")

        station.download(logs[-1], path, watched)
    return logs[-1].size


def _armed(recording: Path) -> list[bool]:
    """Whether the autopilot said that it was armed, over time and from the first time on; empty if it never did."""
    try:
        found = Recording(recording)
        if PREFIX + _STATUS not in found.topics:
            return []
        told = [bool(message.armed) for _, _, message in found.messages([_STATUS])]
    except (ReadError, OSError):
        return []
    return told[told.index(True) :] if True in told else []
