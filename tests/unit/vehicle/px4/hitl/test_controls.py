"""What the firmware asks of the motors, checked before it moves anything."""

import math

import pytest

from vehicle.px4.codec import MESSAGES
from vehicle.px4.hitl.controls import MotorControls
from vehicle.px4.hitl.parameters import firmware_parameters
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.airframe import load_airframe

FIELDS = MESSAGES["HIL_ACTUATOR_CONTROLS"].Fields


def controls(*motors, time_us=1000, armed=True, flags=1, hil=False):
    values = (*motors, *(0.0,) * (16 - len(motors)))
    return FIELDS(time_us, values, 1 | (128 if armed else 0) | (32 if hil else 0), flags)


def received(*messages):
    found = MotorControls()
    for message in messages:
        found.receive(message)
    return found


def test_controls_are_shares_of_full_thrust_in_our_motor_order():
    found = received(controls(0.1, 0.2, 0.3, 0.4, hil=True))
    assert found.motors == pytest.approx((0.1, 0.2, 0.3, 0.4))
    assert (found.armed, found.lockstep, found.hil, found.time_us) == (True, True, True, 1000)
    assert not found.take_faults()


def test_motors_of_a_disarmed_firmware_stand_still():
    assert not received(controls(0.3, 0.3, 0.3, 0.3), controls(0.3, 0.3, 0.3, 0.3, armed=False)).motors.any()


def test_controls_that_are_not_finite_are_rejected_and_told_once():
    found = received(controls(0.5, 0.5, 0.5, 0.5), *(controls(math.nan, 0.5, 0.5, 0.5, time_us=2000),) * 3)
    assert found.motors == pytest.approx(0.5)
    assert (found.rejected, found.time_us) == (3, 1000)
    (text,) = found.take_faults()
    assert "not finite" in text
    assert not found.take_faults()


def test_controls_out_of_range_are_clipped_and_told():
    found = received(controls(-0.4, 1.7, 0.5, 1.0005))
    assert found.motors == pytest.approx((0.0, 1.0, 0.5, 1.0))
    assert ["out of 0..1" in text for text in found.take_faults()] == [True]


def test_more_outputs_than_motors_are_told():
    (text,) = received(controls(0.5, 0.5, 0.5, 0.5, 0.5, 0.5)).take_faults()
    assert "output 6" in text and "4 motors" in text and "CA_ROTOR_COUNT" in text


def test_time_running_backwards_is_rejected_and_told():
    found = received(controls(0.5, 0.5, 0.5, 0.5, time_us=5_000_000), controls(0.1, 0.1, 0.1, 0.1, time_us=4_000))
    assert found.motors == pytest.approx(0.5)
    (text,) = found.take_faults()
    assert "ran back by 4.996 s" in text


@pytest.mark.parametrize("name", ["paper_quad", "sih_quad", "crazyflie"])
def test_geometry_gains_and_hover_thrust_of_an_airframe_are_set(name):
    frame = load_airframe(name)
    values = firmware_parameters(frame)
    assert values["CA_ROTOR_COUNT"] == 4
    assert [math.copysign(1, values[f"CA_ROTOR{i}_PX"]) for i in range(4)] == [1, -1, 1, -1], "front, rear, front, rear"
    assert [math.copysign(1, values[f"CA_ROTOR{i}_PY"]) for i in range(4)] == [1, -1, -1, 1], "right, left, left, right"
    assert [math.copysign(1, values[f"CA_ROTOR{i}_KM"]) for i in range(4)] == [1, 1, -1, -1]
    assert values["MPC_THR_HOVER"] == pytest.approx(1.0 / frame.motors.thrust_to_weight)
    assert values["MC_ROLLRATE_P"] == frame.params_row()[airframe_row.RATE_P]
    assert values["IMU_INTEG_RATE"] == 250


def test_motion_capture_alone_switches_gps_off():
    values = firmware_parameters(load_airframe("paper_quad"), external_pose=True)
    assert (values["EKF2_EV_CTRL"], values["EKF2_GPS_CTRL"], values["SYS_HAS_GPS"]) == (11, 0, 0)
