"""Automatic checks of this computer: disk, recorder, origin of the code, bus."""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

from hil.bench.bus import measure_bus
from hil.bench.devices import Context
from hil.check.judge import Reading
from hil.check.registry import check
from hil.contract.messages import VehicleState
from hil.recording.provenance import ProvenanceError, code
from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PREFIX, Recorder, RecordingError

_TOPIC = "mocap/vehicle"
_MESSAGES = 5000
_LEVEL = (1.0, 0.0, 0.0, 0.0)


@check("host.disk", unit="GB")
def disk(context: Context) -> Reading:
    """Free space where runs are recorded."""
    folder = _existing(context.out)
    return Reading(shutil.disk_usage(folder).free / 1e9, "", str(folder))


@check("host.recorder", unit="messages/s")
def recorder(context: Context) -> Reading:
    """Tried: 5,000 messages written to the run folder, read back and counted."""
    folder = _existing(context.out)
    try:
        with tempfile.TemporaryDirectory(prefix=".check-", dir=folder) as scratch:
            path = Path(scratch) / "check.mcap"
            began = time.perf_counter()
            with Recorder(path, topics=[_TOPIC]) as tap:
                for i in range(_MESSAGES):
                    now = i * 10_000_000
                    still = (0.0, 0.0, 0.0)
                    tap(now, _TOPIC, VehicleState(now, (float(i), 0.0, 0.0), still, _LEVEL, still))
            seconds = time.perf_counter() - began
            recording = Recording(path)
            count = recording.counts()[PREFIX + _TOPIC]
    except (OSError, RecordingError, ReadError) as error:
        return Reading(None, str(error), str(folder), ok=False)
    if count != _MESSAGES or not recording.complete or recording.faults:
        return Reading(None, f"{count} of {_MESSAGES} read back: {recording.faults}", str(folder), ok=False)
    return Reading(round(_MESSAGES / seconds), f"{count} written and read back", str(folder))


@check("host.code")
def origin(context: Context) -> Reading:
    """Commit of the running code: without it a flight is no evidence."""
    try:
        found = code()
    except ProvenanceError as error:
        return Reading(None, str(error), "git", ok=False)
    name = found.commit[:12] or f"package {found.version}"
    return Reading(name, "with uncommitted changes" if found.dirty else "", found.source)


@check("host.bus", unit="ms")
def bus(context: Context) -> Reading:
    """Tried: median latency of the live bus between two leaves on this computer, and whether pictures arrive."""
    report = measure_bus()
    lost = report.sent - report.arrived
    detail = f"worst {report.worst_ms:.1f} ms of {report.arrived}" + (f", {lost} lost" if lost else "")
    detail += f", {report.pictures} of {report.pictures_sent} pictures" + (
        f"; {report.remark}" if report.remark else ""
    )
    failed = lost > 0.02 * report.sent or report.pictures < 0.9 * report.pictures_sent
    return Reading(report.median_ms, detail, "zenoh over loopback", ok=False if failed else None)


@check("host.clock", unit="ms")
def clock(context: Context) -> Reading:
    """Uncertainty of this host's clock against the hub's: half the least round trip. The run corrects the offset."""
    found = context.clocks()
    detail = "the same clock" if found.shared else f"offset {found.offset_ns * 1e-9:.6f} s"
    return Reading(0.0 if found.shared else found.error_ns * 1e-6, detail, f"hub at {context.endpoint}")


@check("host.date", unit="s")
def date(context: Context) -> Reading:
    """How far this host's date is from that of the hub's host: certificates, signatures and file times use it."""
    found = context.clocks()
    return Reading(abs(found.date_ns) * 1e-9, "set both clocks by NTP", f"hub at {context.endpoint}")


def _existing(folder: Path) -> Path:
    folder = folder.resolve()
    while not folder.is_dir():
        folder = folder.parent
    return folder
