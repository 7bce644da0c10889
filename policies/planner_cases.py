"""Board motions that the planner is judged on: the paper's T1-T3 and the scenarios' path and speed laws, by name."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundcar import motion as mo
from groundcar import speed_laws as laws
from groundcar import splines
from groundcar import trajectories as tr
from kernel import njit
from kernel.random import stream, uniform


@dataclass(frozen=True)
class Case:
    """A family of board motions. `speed` m/s; `law`: ou, constant, cosine, scheduled; `lead` s driven before."""

    path: str
    law: str
    speed: float
    inclination_deg: float
    time_limit: float
    lead: float = 1.0


CASES = {
    "static65": Case("static", "constant", 0.0, 65.0, 15.0),
    "line45": Case("line", "constant", 2.5, 45.0, 15.0),
    "spline2_70": Case("spline", "ou", 2.0, 70.0, 15.0),
    "hard1": Case("spline", "cosine", 2.5, 70.0, 15.0),
    "hard2": Case("spline", "scheduled", 2.2, 70.0, 15.0),
    "t1": Case("spline", "ou", 3.0, 0.0, 5.0, 0.0),
    "t2": Case("spline", "ou", 2.0, 30.0, 5.0, 0.0),
    "t3": Case("spline", "ou", 1.0, 60.0, 5.0, 0.0),
}


@njit
def _roll_out(row, aux, lead, rng, out):
    for _ in range(lead):
        mo.motion_step(row, aux, 0.01, rng)
    for k in range(out.shape[0]):
        out[k] = row
        mo.motion_step(row, aux, 0.01, rng)


def board_motion(case: Case, seed: int, index: int, steps: int) -> np.ndarray:
    """Platform rows (steps, 8) every 10 ms of one draw of a case. The car follows its law with a lag of some 0.1 s."""
    rng = stream(seed, index, 77)
    heading = uniform(rng, -math.pi, math.pi)
    kwargs: dict[str, float] = {"response": 12.0, "damping": 0.9, "accel_limit": 3.0}
    u, row = 0.0, np.zeros(8)
    if case.path == "static":
        path = tr.static_path(0.0, 0.0, heading)
    elif case.path == "line":
        path, u, kwargs = tr.line_path(12.0, 0.0, 0.0, heading), -0.5 * math.pi, {}
    else:
        path = tr.static_path(0.0, 0.0, heading)
        splines.random_spline(rng, path, case.speed)
        u = uniform(rng, 0.0, 12.0)
    if case.law == "cosine":
        law = laws.cosine_speed(1.0, case.speed, 3.0, uniform(rng, 0.0, 2 * math.pi))
    elif case.law == "scheduled":
        law = laws.scheduled_speed(case.speed, 1.5, 0.5)
        kwargs |= {"change_time": uniform(rng, 3.0, 4.0), "arc_radius": 3.0 if uniform(rng, 0, 1) < 0.5 else -3.0}
    else:
        law = laws.ou_speed(case.speed) if case.law == "ou" else laws.constant_speed(case.speed)
    aux = mo.motion_aux(tr.KINDS[case.path], path, laws.KINDS[case.law], law, **kwargs)
    out = np.zeros((steps, 8))
    mo.motion_reset(row, aux, u, 1.5, math.radians(case.inclination_deg), True)
    _roll_out(row, aux, round(case.lead / 0.01), rng, out)
    return out


def board_motions(name: str, count: int, seed: int = 0, extra: float = 3.3) -> np.ndarray:
    """`count` draws of a named case, (count, S, 8), `extra` s longer than its time limit. Raises KeyError."""
    case = CASES[name]
    steps = round((case.time_limit + extra) / 0.01)
    return np.stack([board_motion(case, seed, i, steps) for i in range(count)])
