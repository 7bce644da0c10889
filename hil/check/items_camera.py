"""Automatic checks of the camera, the tags and the board's inclination."""

from __future__ import annotations

from statistics import fmean, median

from hil.bench.camera import BoardMeasurement
from hil.bench.devices import Context
from hil.bench.reading import Unavailable
from hil.check.judge import Reading
from hil.check.registry import check


@check("camera.mode")
def mode(context: Context) -> Reading:
    """Delivered picture size and rate, against the calibration and the scenario."""
    bench = context.camera()
    width, height, rate = bench.mode
    wanted = (bench.camera.width, bench.camera.height, bench.wanted_hz)
    fine = (width, height) == wanted[:2] and rate >= 0.97 * wanted[2]  # measured over a second, where it is a device
    detail = "" if fine else f"wanted {wanted[0]}x{wanted[1]} at {wanted[2]:g} Hz"
    return Reading(f"{width}x{height} at {rate:g} Hz", detail, bench.source, ok=fine)


@check("camera.decode", unit="%")
def decode(context: Context, *, distance: float = 2.0) -> Reading:
    """Share of ten pictures from `distance` (m) in which the board's pose is found."""
    bench = context.camera()
    seen = bench.measure_board(distance)
    found = [s for s in seen if s.pose.found]
    why = sorted({s.pose.reason for s in seen if not s.pose.found})
    tags = sorted({i for s in found for i in s.pose.ids})
    return Reading(
        100.0 * len(found) / len(seen), f"tags {tags}" + (f"; {', '.join(why)}" if why else ""), bench.source
    )


@check("camera.distance", unit="m")
def distance_error(context: Context, *, distance: float = 2.0) -> Reading:
    """Measured less set distance (m, absolute): scale of the print, focus and calibration."""
    measured = fmean(s.distance for s in _found(context, distance))
    return Reading(abs(measured - distance), f"measured {measured:.3f} m, set {distance:g} m", context.camera().source)


@check("camera.layout", unit="px")
def layout(context: Context, *, distance: float = 2.0) -> Reading:
    """Reprojection error of the board's own layout: the printed tags are where the file says."""
    seen = _found(context, distance)
    known = set(context.camera().board.corners_by_id)
    strange = sorted({i for s in seen for i in s.pose.ids} - known)
    if strange:
        return Reading(None, f"tags {strange} are not on this board", context.camera().source, ok=False)
    return Reading(median(s.pose.rms for s in seen), "", context.camera().source)


@check("camera.contrast", unit="DN")
def contrast(context: Context, *, distance: float = 2.0) -> Reading:
    """Contrast of the tags: exposure, gain and glare."""
    seen = _found(context, distance)
    mean = fmean(s.brightness for s in seen)
    return Reading(fmean(s.contrast for s in seen), f"mean brightness {mean:.0f} DN", context.camera().source)


@check("board.inclination", unit="deg")
def inclination(context: Context, *, distance: float = 2.0) -> Reading:
    """Inclination measured by the camera less the one the scenario sets (absolute)."""
    bench = context.camera()
    measured = fmean(s.inclination for s in _found(context, distance))
    detail = f"measured {measured:.2f}, set {bench.set_deg:g} deg"
    return Reading(abs(measured - bench.set_deg), detail, bench.source)


def _found(context: Context, distance: float) -> list[BoardMeasurement]:
    seen = context.camera().measure_board(distance)
    found = [s for s in seen if s.pose.found]
    if not found:
        raise Unavailable(f"the board is in none of {len(seen)} pictures: {seen[-1].pose.reason}")
    return found
