"""Why a run had no attempt: one line, with the cause that the vehicle's driver gave."""

import pytest

from hil.host.failure import why_no_attempt

GAVE_UP = ("director", "the vehicle did not reach its start (failed)")
ARMED = ("vehicle_link", "the vehicle is already armed. Land and disarm it first")


@pytest.mark.parametrize(
    ("errors", "why"),
    [
        ([], ""),
        ([ARMED], ""),
        ([GAVE_UP], GAVE_UP[1]),
        ([ARMED, GAVE_UP], f"{GAVE_UP[1]}: {ARMED[1]}"),
        ([("gate", "gate tripped"), ("vehicle_link", "first"), ARMED, GAVE_UP], f"{GAVE_UP[1]}: {ARMED[1]}"),
        ([ARMED, GAVE_UP, ("vehicle_link", "link lost")], f"{GAVE_UP[1]}: {ARMED[1]}"),
    ],
)
def test_line_names_what_the_director_gave_up_with_and_its_cause(errors, why):
    assert why_no_attempt(errors) == why
