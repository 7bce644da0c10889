"""Parameters: their field on the wire, and what is judged."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.vehicle.px4.driver.driver_bench import START
from vehicle.px4.driver.params import INT32, REAL32, judge, pack_value, unpack_value
from vehicle.px4.driver.types import LinkConfig

CONFIG = LinkConfig(start=START, hover_thrust=0.44)


@given(st.integers(-(2**31), 2**31 - 1))
def test_integers_survive_the_float_field(value):
    assert unpack_value(pack_value(value, INT32), INT32) == value


@given(st.floats(width=32, allow_nan=False))
def test_floats_survive_the_float_field(value):
    assert unpack_value(pack_value(value, REAL32), REAL32) == value
    assert unpack_value(bytes(4), 5) is None


SOUND = {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 4, "CBRK_FLIGHTTERM": 121212, "FD_FAIL_P": 60, "FD_FAIL_R": 60}
SOUND |= {"MPC_THR_HOVER": 0.45, "EKF2_EV_CTRL": 15, "EKF2_HGT_REF": 3, "SYS_HAS_MAG": 0, "EKF2_MAG_TYPE": 5}


def test_valid_parameters_pass():
    assert judge(SOUND, CONFIG) == []
    assert judge(SOUND, LinkConfig(start=START, hover_thrust=0.44, external_vision=True)) == []


@pytest.mark.parametrize(
    ("changed", "advice"),
    [
        ({"COM_OF_LOSS_T": 1.0}, "0.2 to 0.3 s is advisable"),
        ({"COM_OF_LOSS_T": 0.2}, "set gap_limit below it"),
        ({"COM_OBL_RC_ACT": 0}, "4 \\(land\\) or 5 \\(hold\\)"),
        ({"CBRK_FLIGHTTERM": 0}, "FD_FAIL_P 60, FD_FAIL_R 60 deg.*CBRK_FLIGHTTERM 121212"),
        ({"CBRK_FLIGHTTERM": 0, "FD_FAIL_R": 0}, "FD_FAIL_P 60 deg"),
        ({"MPC_THR_HOVER": 0.6}, "MPC_THR_HOVER is 0.600, the airframe file gives 0.440"),
        ({"EKF2_EV_CTRL": 1}, "11 or 15"),
        ({"EKF2_HGT_REF": 1}, "reboot"),
        ({"SYS_HAS_MAG": 1}, "motion capture"),
    ],
)
def test_each_bad_parameter_is_named_with_advice(changed, advice):
    config = LinkConfig(start=START, hover_thrust=0.44, external_vision=any("EKF2" in n or "MAG" in n for n in changed))
    (text,) = judge(SOUND | changed, config)
    assert re.search(advice, text)


def test_raised_or_switched_off_attitude_limits_pass():
    assert judge(SOUND | {"CBRK_FLIGHTTERM": 0, "FD_FAIL_P": 85, "FD_FAIL_R": 0}, CONFIG) == []


@pytest.mark.parametrize(
    ("steepest", "limit", "warned"), [(70, 79, True), (70, 80, False), (45, 60, False), (0, 9, True)]
)
def test_failure_detector_limits_are_compared_with_the_inclination(steepest, limit, warned):
    config = LinkConfig(start=START, hover_thrust=0.44, steepest=math.radians(steepest))
    reported = judge(SOUND | {"CBRK_FLIGHTTERM": 0, "FD_FAIL_P": limit, "FD_FAIL_R": limit}, config)
    assert len(reported) == warned
    assert all(f"raise them to {steepest + 10} or more" in text for text in reported)


def test_parameters_missing_in_px4_are_not_judged():
    assert judge({}, CONFIG) == []
