"""Position, velocity and attitude of vehicle and board over time, as in the paper's figure of a flight."""

from __future__ import annotations

import numpy as np

from hil.report.drawing.charts import BELIEF, BOARD, VEHICLE, TimePlot
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import Motion, heading_deg, nose_up_deg, roll_deg, side_up_deg, yaw_deg

_AXES = ("east", "north", "up")


def build(recorded: Recorded) -> Section:
    section = Section("motion", "Position, velocity and attitude of vehicle and board")
    bodies: list[tuple[str, str, Motion]] = []
    if section.needs_pose(recorded, "motion of the vehicle", board=False):
        assert recorded.vehicle is not None
        bodies.append(("vehicle", VEHICLE, recorded.vehicle))
    if section.needs_pose(recorded, "motion of the board", vehicle=False):
        assert recorded.board is not None
        bodies.append(("board", BOARD, recorded.board))
    if not bodies:
        return section
    _attitude(section, bodies)
    belief = recorded.topics.get("belief")
    for axis, name in enumerate(_AXES):
        plot = TimePlot(f"position-{axis}", f"Position, {name}: vehicle, and the board it flies to", "m", height=110)
        for body, colour, motion in bodies:
            plot.add(body, colour, motion.t, motion.position[:, axis])
        if belief is not None:
            believed = np.where(belief["valid"] > 0, belief["position"][:, axis], np.nan)
            plot.add("board, believed", BELIEF, belief.nanoseconds(), believed, "dash")
        section.plot(plot)
    speed = TimePlot("speed", "Speed", "m/s")
    for body, colour, motion in bodies:
        speed.add(body, colour, motion.t, np.linalg.norm(motion.velocity, axis=1))
    section.plot(speed)
    for axis, name in enumerate(_AXES):
        plot = TimePlot(f"velocity-{axis}", f"Velocity, {name}", "m/s", height=110)
        for body, colour, motion in bodies:
            plot.add(body, colour, motion.t, motion.velocity[:, axis])
        section.plot(plot)
    return section


def _attitude(section: Section, bodies: list[tuple[str, str, Motion]]) -> None:
    """Roll, pitch and yaw; of the board its inclination and its heading."""
    roll = TimePlot("roll", "Roll: right side down", "deg", height=110)
    pitch = TimePlot("pitch", "Pitch: nose up, and the board's inclination", "deg")
    yaw = TimePlot("yaw", "Yaw: counter-clockwise from east, and the board's heading", "deg", height=110)
    for body, colour, motion in bodies:
        about_x, about_z = (side_up_deg, heading_deg) if body == "board" else (roll_deg, yaw_deg)
        roll.add(body, colour, motion.t, about_x(motion.orientation))
        pitch.add(body, colour, motion.t, nose_up_deg(motion.orientation))
        yaw.add(body, colour, motion.t, about_z(motion.orientation))
    for plot in (roll, pitch, yaw):
        section.plot(plot)
