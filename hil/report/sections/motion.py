"""Velocity and pitch of vehicle and board over time, as in the paper's figure of a flight."""

from __future__ import annotations

import numpy as np

from hil.report.drawing.charts import BOARD, VEHICLE, TimePlot
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion, nose_up_deg


def build(recorded: Recorded) -> Section:
    section = Section("motion", "Velocity and pitch of vehicle and board")
    bodies: list[tuple[str, str, Motion]] = []
    if section.needs_pose(recorded, "velocity and pitch of the vehicle", board=False):
        assert recorded.vehicle is not None
        bodies.append(("vehicle", VEHICLE, recorded.vehicle))
    if section.needs_pose(recorded, "velocity and pitch of the board", vehicle=False):
        assert recorded.board is not None
        bodies.append(("board", BOARD, recorded.board))
    if not bodies:
        return section
    speed = TimePlot("speed", "Speed", "m/s")
    pitch = TimePlot("pitch", "Pitch: nose up, and the board's inclination", "deg")
    height = TimePlot("height", "Height of centre of mass and of the board's centre", "m", height=120)
    for name, colour, motion in bodies:
        speed.add(name, colour, motion.t, np.linalg.norm(motion.velocity, axis=1))
        pitch.add(name, colour, motion.t, nose_up_deg(motion.orientation))
        height.add(name, colour, motion.t, motion.position[:, 2])
    for plot in (speed, pitch, height):
        section.plot(plot)
    for axis, name in enumerate(("east", "north", "up")):
        plot = TimePlot(f"velocity-{axis}", f"Velocity, {name}", "m/s", height=110)
        for body, colour, motion in bodies:
            plot.add(body, colour, motion.t, motion.velocity[:, axis])
        section.plot(plot)
    return section
