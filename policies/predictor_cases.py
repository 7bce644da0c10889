"""Boards on a simulated Scout Mini under its follower: motions the predictor never trained on, to judge it by."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from groundcar import motion as mo
from groundcar import speed_laws as laws
from groundcar import trajectories as tr
from groundcar.follower import Follower
from groundcar.scout_link import ScoutLink
from groundcar.scout_sim import ScoutSim
from groundcar.splines import random_spline
from kernel.random import stream, uniform

SCOUT_CASES = ("scout_hard1", "scout_normal", "scout_hard2")
_TICK_NS = 10_000_000
_START_NS = 1_000_000_000


class _End:
    """One end of a bus in memory."""

    def __init__(self) -> None:
        self.inbound: list[Any] = []
        self.peer: _End = self

    def send(self, frame: Any) -> None:
        self.peer.inbound.append(frame)

    def receive(self) -> list[Any]:
        frames, self.inbound = self.inbound, []
        return frames


def _reference(name: str, rng: np.ndarray) -> tuple[np.ndarray, float]:
    path = tr.static_path(0.0, 0.0, uniform(rng, -math.pi, math.pi))
    top = {"scout_hard1": 2.5, "scout_normal": 2.0, "scout_hard2": 2.2}[name]
    random_spline(rng, path, top)
    start, phase, change = uniform(rng, 0.0, 12.0), uniform(rng, 0.0, 2.0 * math.pi), uniform(rng, 3.0, 4.0)
    if name == "scout_hard1":
        law = laws.cosine_speed(1.0, top, 3.0, phase)
        return mo.motion_aux(tr.SPLINE, path, laws.COSINE, law), start
    if name == "scout_normal":
        return mo.motion_aux(tr.SPLINE, path, laws.CONSTANT, laws.constant_speed(top)), start
    law = laws.scheduled_speed(top, 1.5, 0.5)
    return mo.motion_aux(tr.SPLINE, path, laws.SCHEDULED, law, change_time=change, arc_radius=3.0), start


def scout_motion(name: str, seed: int, index: int, steps: int, lead: float = 1.0, inclination_deg: float = 70.0):
    """Platform rows (steps, 8) every 10 ms, from `lead` s after the car set off. Raises KeyError for another name."""
    rng = stream(seed, index, 0x5C07)
    aux, start = _reference(name, rng)
    follower = Follower(aux, start, rng)
    ours, cars = _End(), _End()
    ours.peer, cars.peer = cars, ours
    sim, link = ScoutSim(cars, seed=seed * 10_000 + index, pose=follower.start_pose), ScoutLink(ours)
    follower.start(_START_NS)
    out, first = np.zeros((steps, 8)), (_START_NS + round(lead * 1e9)) // _TICK_NS
    for k in range(first + steps):
        now = k * _TICK_NS
        sim.step(now)
        if k % 2 == 0:
            _, command = follower.step(now, *sim.pose, sim.speed, sim.turn_rate, now)
            link.step(now, command)
        if k >= first:
            sim.platform_row(1.5, math.radians(inclination_deg), out[k - first])
    return out


def scout_motions(name: str, count: int, seed: int, seconds: float = 18.3) -> np.ndarray:
    """`count` drives of a SCOUT_CASES name, (count, S, 8)."""
    return np.stack([scout_motion(name, seed, i, round(seconds * 100)) for i in range(count)])
