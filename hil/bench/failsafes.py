"""A test flight of a simulated autopilot's failsafes: loss of the OFFBOARD stream, and the kill command in the air."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.assembly.rig import Rig
from hil.bench.reading import Unavailable
from hil.bench.vehicle import Bench, SimulatedBench
from scenarios.draw import Drawn
from vehicle.px4 import protocol as px4
from vehicle.px4.driver.types import Rates
from vehicle.px4.sim.autopilot import Truth
from vehicle.quadrotor.airframe import GRAVITY, Airframe

_MS = 1_000_000
_FLIGHT_LIMIT_NS = 120_000_000_000


@dataclass(frozen=True)
class TrialReport:
    """Result of a test flight. Seconds; None: it did not happen."""

    loss_s: float | None  # last set-point to the autopilot leaving OFFBOARD
    loss_mode: str
    kill_s: float | None  # kill command to disarmed
    motors_off_s: float | None  # kill command to no thrust of any motor
    notes: tuple[str, ...]
    source: str = "software PX4, flown to a hover for it"


def try_failsafes(airframe: Airframe, rig: Rig, drawn: Drawn) -> TrialReport:
    """Fly to a hover, hand over, stop the driver as if its process had ended, measure the autopilot's reaction; then
    kill it in the air."""
    bench = SimulatedBench(airframe, rig, drawn, arm=True)
    if not _fly_to_hover(bench):
        raise Unavailable(
            f"the trial flight did not reach its hover: {'; '.join(bench.notes[-2:]) or bench.link.phase}"
        )
    last_ns = handed_ns = bench.clock.now_ns
    while bench.clock.now_ns - handed_ns < 500 * _MS:
        due = bench.clock.now_ns - last_ns >= 10 * _MS
        last_ns = bench.clock.now_ns if due else last_ns
        bench.step(Rates((0.0, 0.0, 0.0), GRAVITY) if due else None)
    loss_ns, mode = None, "OFFBOARD"
    while loss_ns is None and bench.clock.now_ns - last_ns < 5_000_000_000:
        bench.pace()
        if bench.sim.flight.active != px4.OFFBOARD:
            loss_ns, mode = bench.clock.now_ns - last_ns, px4.mode_name(bench.sim.flight.active)
    kill_ns, motors_ns = _kill(bench)
    return TrialReport(_seconds(loss_ns), mode, _seconds(kill_ns), _seconds(motors_ns), tuple(bench.notes))


def _fly_to_hover(bench: Bench) -> bool:
    while bench.clock.now_ns < _FLIGHT_LIMIT_NS:
        output = bench.step()
        if output.phase in ("hover", "failed"):
            return output.phase == "hover"
    return False


def _kill(bench: SimulatedBench) -> tuple[int | None, int | None]:
    asked = bench.clock.now_ns
    bench.link.kill()
    kill_ns = motors_ns = None
    while bench.clock.now_ns - asked < 3_000_000_000 and (kill_ns is None or motors_ns is None):
        output = bench.step()
        after = bench.clock.now_ns - asked
        if kill_ns is None and not output.armed:
            kill_ns = after
        if motors_ns is None and _still(bench.sim.truth()):
            motors_ns = after
    return kill_ns, motors_ns


def _still(truth: Truth) -> bool:
    """True once no motor gives more than 2 % of its thrust."""
    return not truth.armed and max(map(math.fabs, truth.motors)) < 0.02


def _seconds(ns: int | None) -> float | None:
    return None if ns is None else ns * 1e-9
