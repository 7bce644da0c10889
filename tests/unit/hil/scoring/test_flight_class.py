"""Every flight gets exactly one class, by its definition."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.contract import messages as m
from hil.scoring.flight_class import ABORTED, CLASSES, DEFINITIONS, MISSED, PERCHED, UNSAFE, FlightJudge

MS = 1_000_000
LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
FENCE = ((-25.0, 25.0), (-25.0, 25.0), (0.3, 9.0))
BOARD = m.BoardState(0, (3.0, 0.0, 1.5), ZERO, LEVEL, 0.0, 0.0, 0.0)
MISS = m.Contact(0, "fail", "time", False, False, 0, 0, 0, 0, 0)
HELD = replace(MISS, outcome="success", reason="", attached=True)
SENT = m.Sent(0, ZERO, 9.8, 0.5, False, "")


def status(phase="handed_over", failsafe=False):
    return m.VehicleStatus(0, True, True, False, failsafe, "OFFBOARD", phase, 15.0, 0.5)


def vehicle(position, velocity=ZERO):
    return m.VehicleState(0, position, velocity, LEVEL, ZERO)


def judged(*messages, faults=(), motors_off=True, trouble="", attempt=True):
    """The class of a flight that takes off from the ground, then gets `messages` as (topic, message)."""
    judge = FlightJudge(FENCE, 0.42, faults)
    start = [("truth/board", BOARD), ("truth/vehicle", vehicle((0.0, 0.0, 0.0)))]
    start += [("truth/vehicle", vehicle((0.0, 0.0, 2.0)))]
    stage = [("run/stage", m.Stage(0, "attempt", 1, 1))] if attempt else []
    for now, (topic, message) in enumerate([*start, *stage, *messages]):
        judge(now * MS, topic, message)
    return judge.result(motors_off, trouble)


LANDED = ("truth/vehicle", vehicle((1.0, 0.0, 0.0)))
ON_BOARD = ("truth/vehicle", vehicle((3.0, 0.0, 1.55)))


def test_every_class_is_defined():
    assert set(DEFINITIONS) == set(CLASSES)


@pytest.mark.parametrize(
    ("messages", "expected"),
    [
        ([("referee/contact", HELD), ON_BOARD], PERCHED),
        ([("referee/contact", MISS), LANDED], MISSED),
        ([("vehicle/sent", replace(SENT, tripped="too fast")), ("referee/contact", MISS), LANDED], ABORTED),
        ([("vehicle/status", status("interrupted")), ("referee/contact", MISS), LANDED], ABORTED),
        ([("vehicle/status", status(failsafe=True)), ("referee/contact", MISS), LANDED], ABORTED),
        ([("referee/contact", MISS), ("vehicle/status", status("interrupted")), LANDED], MISSED),
    ],
)
def test_safe_endings(messages, expected):
    assert judged(*messages).name == expected


def test_vehicle_that_the_magnet_did_not_hold_has_missed():
    found = judged(("referee/contact", HELD), ON_BOARD, LANDED)
    assert (found.name, found.why) == (MISSED, ("the magnet did not hold",))


def test_attempt_given_up_by_the_host_or_never_begun_is_aborted():
    assert judged(LANDED, trouble="camera has not published").name == ABORTED
    assert judged(LANDED, attempt=False).name == ABORTED


@pytest.mark.parametrize(
    ("messages", "why"),
    [
        ([("truth/vehicle", vehicle((30.5, 0.0, 2.0))), ("referee/contact", MISS), LANDED], "outside its fence"),
        ([("truth/vehicle", vehicle((1.0, 0.0, 14.5))), ("referee/contact", MISS), LANDED], "outside its fence"),
        (
            [("truth/vehicle", vehicle((1, 0, 0.1), (0, 0, -2.5))), ("referee/contact", MISS), LANDED],
            "the ground at 2.5",
        ),
        (
            [
                ("truth/vehicle", vehicle((3.0, 0.0, 1.7), (0, 0, -3.0))),
                ("truth/vehicle", vehicle((3.0, 0.0, 1.5), (0, 0, -3.0))),
                ("referee/contact", MISS),
                LANDED,
            ],
            "the board at 3.0",
        ),
        (
            [("vehicle/sent", replace(SENT, tripped="x")), ("vehicle/sent", SENT), ("referee/contact", MISS), LANDED],
            "vehicle after its gate",
        ),
        (
            [
                ("event", m.Event(0, "error", "car_gate", "gate tripped: x")),
                ("car/sent", m.CarCommand(0, 0.0, 0.0)),
                ("referee/contact", MISS),
                LANDED,
            ],
            "car after its gate",
        ),
        ([("referee/contact", MISS)], "neither on the board nor on the ground"),
        ([LANDED], "no class"),
    ],
)
def test_unsafe_endings_say_why(messages, why):
    found = judged(*messages)
    assert found.name == UNSAFE and any(why in text for text in found.why)


def test_motors_that_run_on_are_unsafe():
    found = judged(("referee/contact", MISS), LANDED, motors_off=False)
    assert found.name == UNSAFE and "motors" in found.why[0]


def test_slow_landing_and_slow_contact_are_not_unsafe():
    slow = [("truth/vehicle", vehicle((1, 0, 0.06), (0, 0, -0.7))), ("referee/contact", MISS), LANDED]
    assert judged(*slow).name == MISSED
    contact = [("truth/vehicle", vehicle((3.0, 0.0, z), (0, 0, -0.6))) for z in (1.6, 1.53)]
    assert judged(*contact, ("referee/contact", HELD), ON_BOARD).name == PERCHED


def test_fault_that_never_began_is_named():
    begun = ("run/fault", m.Faults(0, (0,), (0,)))
    assert judged(("referee/contact", MISS), begun, LANDED, faults=("a", "b")).not_begun == ("b",)


NUMBER = st.floats(-40, 40) | st.sampled_from([float("nan"), float("inf")])
TRIPLE = st.tuples(NUMBER, NUMBER, NUMBER)
MESSAGE = st.one_of(
    st.builds(lambda p, v: ("truth/vehicle", vehicle(p, v)), TRIPLE, TRIPLE),
    st.sampled_from([LANDED, ON_BOARD, ("referee/contact", MISS), ("referee/contact", HELD), ("vehicle/sent", SENT)]),
    st.builds(
        lambda phase, on: ("vehicle/status", status(phase, on)), st.sampled_from(["hover", "failed"]), st.booleans()
    ),
)


@given(st.lists(MESSAGE, max_size=12), st.booleans(), st.sampled_from(["", "lost"]), st.booleans())
def test_any_flight_has_exactly_one_class(messages, motors_off, trouble, attempt):
    found = judged(*messages, motors_off=motors_off, trouble=trouble, attempt=attempt)
    assert found.name in CLASSES and (found.name == UNSAFE) <= bool(found.why)
