"""The exit code of `perch-hil run`."""

from types import SimpleNamespace

import pytest

from hil.cli.options import COULD_NOT_RUN, INTERRUPTED, NOT_PERCHED, PERCHED
from hil.cli.run import _exit_code
from tests.unit.hil.cli.test_console import score


def flown(failure="", interrupted=False, **words):
    return SimpleNamespace(flight=SimpleNamespace(score=score(**words), failure=failure, interrupted=interrupted))


@pytest.mark.parametrize(
    ("last", "code"),
    [
        (flown(), PERCHED),
        (flown(within=False), NOT_PERCHED),
        (flown(attached=False), NOT_PERCHED),  # also within tolerance
        (flown(failure="no link"), COULD_NOT_RUN),
        (flown(failure="no link", interrupted=True), INTERRUPTED),
    ],
)
def test_the_exit_code_is_that_of_the_worst_flight(last, code):
    assert _exit_code([flown(), last]) == code
