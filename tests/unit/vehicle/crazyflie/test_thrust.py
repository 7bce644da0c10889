"""Thrust words: linear in force, and bounded by what the battery gives."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.crazyflie.commands import FULL_WORD
from vehicle.crazyflie.thrust import FULL_FORCE, available_force, force_of, word_of


@given(st.floats(0, FULL_FORCE))
def test_word_and_force_are_inverse_to_each_other(force):
    assert force_of(word_of(force)) == pytest.approx(force, abs=FULL_FORCE / FULL_WORD)


def test_full_battery_gives_all_that_the_firmware_asks_for_and_an_empty_one_does_not():
    assert available_force(4.0) == FULL_FORCE
    assert 0.0 < available_force(2.9) < FULL_FORCE
    assert available_force(0.0) == 0.0


@pytest.mark.parametrize(("force", "word"), [(-1.0, 0), (1.0, FULL_WORD)])
def test_force_beyond_the_motors_is_the_nearest_word(force, word):
    assert word_of(force) == word
