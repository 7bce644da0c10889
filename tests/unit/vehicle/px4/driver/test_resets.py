"""Resets of the autopilot's estimate: what jumped is measured, and only a jump that matters is a warning."""

import math

import pytest

from kernel.rotations import from_euler
from tests.unit.vehicle.px4.driver.driver_bench import Bench
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.driver.resets import Reset, ResetNotes, note_of, reset_between
from vehicle.px4.driver.types import Note, Odometry

MS = 1_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def sample(ms, position=(0.0, 0.0, 2.0), velocity=(0.0, 0.0, 0.0), yaw=0.0, rate=(0.0, 0.0, 0.0)):
    return Odometry(ms * MS, position, velocity, from_euler(0.0, 0.0, yaw), rate)


def test_motion_is_no_jump():
    before = sample(0, (1.0, 2.0, 3.0), (5.0, -3.0, 1.0), 0.3, (0.0, 0.0, 2.0))
    after = sample(10, (1.05, 1.97, 3.01), (5.1, -3.0, 1.0), 0.32, (0.0, 0.0, 2.0))
    found = reset_between(before, after)
    assert found is not None
    assert found == pytest.approx((0.0, 0.1, 0.0), abs=1e-6)
    assert note_of(found, hovering=True).severity == "info"


@pytest.mark.parametrize(
    ("after", "hovering", "severity"),
    [
        (sample(10, yaw=math.radians(9.0)), False, "info"),  # PX4's own reset of its heading after take-off
        (sample(10, yaw=math.radians(9.0)), True, "warning"),
        (sample(10, (0.2, 0.0, 2.0)), False, "info"),
        (sample(10, (0.2, 0.0, 2.0)), True, "warning"),
        (sample(10, (0.7, 0.0, 2.0)), False, "warning"),
        (sample(10, velocity=(0.4, 0.0, 0.0)), True, "warning"),
        (sample(10, (0.01, 0.0, 2.0), (0.1, 0.0, 0.0), math.radians(0.5)), True, "info"),
    ],
)
def test_jump_is_a_warning_only_where_it_matters(after, hovering, severity):
    note = note_of(reset_between(sample(0), after), hovering=hovering)
    assert note.severity == severity
    assert note.text.startswith("the autopilot's estimate was reset by ")


def test_reset_of_a_real_px4s_heading_after_its_take_off_is_an_information():
    """PX4 v1.17 on its simulated quadrotor, 1.6 m up: two samples of ODOMETRY in NED, as they came."""
    before = Odometry(
        14_588_000_000, (0.2424, -0.211, -1.6045), (-0.0675, 0.0665, -0.6683), (0.999, 0.0025, 0.0022, -0.0442),
        (-0.0527, -0.0014, -0.0023),
    )  # fmt: skip
    after = Odometry(
        14_620_000_000, (0.243, -0.2128, -1.6216), (-0.0581, 0.0799, -0.6836), (1.0, 0.0024, 0.0025, 0.0075),
        (-0.0597, 0.0131, -0.0039),
    )  # fmt: skip
    found = reset_between(before, after)
    assert note_of(found, hovering=False) == Note(
        "info", "the autopilot's estimate was reset by 0.01 m, 0.02 m/s, 5.8 deg"
    )
    assert note_of(found, hovering=True).severity == "warning"


def test_reset_while_no_odometry_came_cannot_be_measured_and_is_a_warning():
    assert reset_between(sample(0), sample(110)) is None
    assert note_of(None, hovering=False).severity == "warning"


def told(*timed):
    """The texts of resets at times in ms."""
    notes = ResetNotes()
    return [note.text for ms, reset in timed for note in notes.take(ms * MS, [reset], hovering=True)]


def test_resets_that_repeat_are_told_once_a_second_and_counted():
    reset = Reset(0.2, 0.4, 0.0)
    texts = told(*((ms, reset) for ms in range(0, 3_000, 100)))
    more = f"{reset.text}; 9 since the one before"
    assert texts == [reset.text, more, more]


def test_much_larger_reset_is_told_at_once():
    small, alike, turned = Reset(0.2, 0.4, 0.0), Reset(0.3, 0.4, 0.0), Reset(0.1, 0.1, 0.4)
    assert told((0, small), (100, alike), (200, turned)) == [small.text, f"{turned.text}; 1 since the one before"]


def test_reset_that_is_a_warning_is_told_at_once_after_one_that_was_none():
    notes, reset = ResetNotes(), Reset(0.2, 0.4, 0.0)
    given = [notes.take(ms * MS, [reset], hovering=hovering) for ms, hovering in ((0, False), (100, True), (200, True))]
    assert [[note.severity for note in each] for each in given] == [["info"], ["warning"], []]


def test_reset_that_cannot_be_measured_is_told_at_once_and_once():
    texts = told((0, Reset(9.0, 9.0, 0.0)), (100, None), (200, None), (300, Reset(9.0, 9.0, 0.0)))
    assert len(texts) == 2 and "no odometry came" in texts[1]


class Jump:
    """From now on the autopilot's odometry lies `metres` further north, and has been reset once more."""

    def __init__(self, bench, metres):
        self._receive, self._metres = bench.tap.receive, metres
        self._parser, self._packer = Parser(), Packer(1, 1)
        bench.tap.receive = self

    def __call__(self):
        return [self._moved(frame) for data in self._receive() for frame in self._parser.feed(data)]

    def _moved(self, frame):
        if frame.name != "ODOMETRY":
            return frame.raw
        f = frame.fields
        return self._packer.pack(frame.message, *f._replace(x=f.x + self._metres, reset_counter=f.reset_counter + 1))


@pytest.mark.parametrize(("phase", "severity"), [("goto", "info"), ("hover", "warning")])
def test_driver_tells_a_reset_once_and_by_the_phase_in_which_it_comes(phase, severity):
    bench = Bench().to(phase)
    bench.run(0.3)
    Jump(bench, 0.3)
    bench.run(0.1)
    (told,) = [note for _, note in bench.notes if "estimate was reset" in note.text]
    assert told.severity == severity
    assert told.text.startswith("the autopilot's estimate was reset by 0.3")
