"""The car under the board: reference, command, feedback and truth."""

from __future__ import annotations

from hil.report.drawing.charts import ASKED, BELIEF, BOARD, VEHICLE, TimePlot
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded

_SOURCES = (
    ("reference", "car/reference", ASKED, "dash"),
    ("commanded", "car/command", VEHICLE, "step"),
    ("reported by the car", "car/feedback", BELIEF, "step"),
)


def build(recorded: Recorded) -> Section:
    section = Section("car", "The car: reference, command, answer")
    speed = TimePlot("car-speed", "Car speed", "m/s", height=130)
    turn = TimePlot("car-turn", "Car turn rate", "rad/s", height=110)
    for name, topic, colour, style in _SOURCES:
        if section.needs(recorded, f"the car's {name.split()[0]} speed and turn rate", topic):
            columns = recorded.topics[topic]
            speed.add(name, colour, columns.nanoseconds(), columns["speed"], style)
            turn.add(name, colour, columns.nanoseconds(), columns["turn_rate"], style)
    if section.needs_pose(recorded, "the car's true speed and turn rate", vehicle=False):
        board = recorded.topics[recorded.board_source]
        speed.add(recorded.board_source, BOARD, board.nanoseconds(), board["speed"])
        turn.add(recorded.board_source, BOARD, board.nanoseconds(), board["turn_rate"])
    if speed.series:
        section.plot(speed)
        section.plot(turn)
    if recorded.has("car/reference") and recorded.board is not None:
        reference = recorded.topics["car/reference"]
        for axis, (name, field) in enumerate((("east", "x"), ("north", "y"))):
            plot = TimePlot(
                f"car-{field}", f"Position, {name}: the car's reference and the board's centre", "m", height=110
            )
            plot.add("reference", ASKED, reference.nanoseconds(), reference[field], "dash")
            plot.add("board", BOARD, recorded.board.t, recorded.board.position[:, axis])
            section.plot(plot)
    return section
