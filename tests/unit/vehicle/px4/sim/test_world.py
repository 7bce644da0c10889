"""Estimate, external vision, wind, magnet, faults, determinism."""

import math

import numpy as np
import pytest

from kernel.rotations import angle_between, from_euler, multiply, rotate
from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.estimator import EstimatorNoise
from vehicle.px4.sim.rows import control
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

VISION = {"EKF2_EV_CTRL": 15, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0}


def vision(rig, frame_id=1, offset=(0.0, 0.0, 0.0), estimator=3):
    truth = rig.sim.truth()
    x, y, z = truth.position[1] + offset[0], truth.position[0] + offset[1], -truth.position[2] + offset[2]
    heading = math.sqrt(0.5)  # facing east
    nan21 = (NAN,) * 21
    rig.send(
        "ODOMETRY", 0, frame_id, 12, x, y, z, (heading, 0.0, 0.0, heading),
        *(0.0,) * 6, nan21, nan21, 0, estimator, 100,
    )  # fmt: skip


def estimated_offset(rig):
    m = rig.of("LOCAL_POSITION_NED")[-1]
    truth = rig.sim.truth()
    return np.array([m.x - truth.position[1], m.y - truth.position[0], m.z + truth.position[2]])


def test_px4_estimate_has_the_configured_noise():
    rig = Rig(noise=EstimatorNoise(position=0.1, position_tau=0.1))
    rig.run(20_000)
    z = [m.x for m in rig.of("LOCAL_POSITION_NED")]
    assert np.std(z) == pytest.approx(0.1, rel=0.25)
    with pytest.raises(ValueError, match="noise"):
        EstimatorNoise(velocity=-1.0).row()


def test_vision_alone_carries_the_estimate_and_arms_offboard_rates_only():
    rig = Rig(ready=False, parameters=VISION)
    rig.run(9000, lambda: vision(rig, offset=(0.5, -0.3, 0.2)), 40)
    assert rig.sim.estimator.vision_active and rig.sim.estimator.yaw_aligned
    assert estimated_offset(rig) == pytest.approx([0.5, -0.3, 0.2], abs=0.03)
    assert rig.of("GLOBAL_POSITION_INT") == []
    assert rig.ask(400, 1.0) == [1]
    rig.run(100, rig.rates)
    rig.mode(6)
    assert rig.ask(400, 1.0) == [0]


def test_vision_in_a_frame_without_north_does_not_align_yaw():
    rig = Rig(ready=False, parameters=VISION)
    rig.run(6000, lambda: vision(rig, frame_id=20), 40)
    assert rig.sim.estimator.vision_active and not rig.sim.estimator.yaw_aligned


def test_vision_is_ignored_by_default_and_noticed_when_switched_on_in_flight():
    rig = Rig()
    rig.run(2000, lambda: vision(rig, offset=(3.0, 0.0, 0.0)), 40)
    assert not rig.sim.estimator.vision_active
    rig.send("PARAM_SET", 1, 1, "EKF2_EV_CTRL", np.frombuffer(np.int32(15).tobytes(), np.float32)[0], 6)
    rig.run(3000, lambda: vision(rig, offset=(3.0, 0.0, 0.0)), 40)
    assert rig.sim.estimator.vision_active
    assert np.abs(estimated_offset(rig)).max() < 0.1  # GPS still holds it
    rig.run(3000)
    assert not rig.sim.estimator.vision_active


def test_switching_height_to_vision_in_flight_makes_z_jump():
    rig = Rig()
    for name, value in (("EKF2_EV_CTRL", 15), ("EKF2_GPS_CTRL", 0), ("EKF2_HGT_REF", 3)):
        rig.send("PARAM_SET", 1, 1, name, np.frombuffer(np.int32(value).tobytes(), np.float32)[0], 6)
    rig.run(5000, lambda: vision(rig), 40)
    x, y, z = estimated_offset(rig)
    assert abs(x) < 0.05 and abs(y) < 0.05 and z == pytest.approx(489.4, abs=1.0)


@pytest.mark.parametrize("kind", [1, 4, 5, 7, 8])
def test_odometry_of_other_estimators_is_refused_with_a_text_each(kind):
    rig = Rig()
    vision(rig, estimator=kind)
    vision(rig, estimator=kind)
    rig.run(8)
    assert rig.texts() == [f"ODOMETRY: estimator_type {kind} unsupported\t"] * 2


def test_losing_gps_ends_the_position_after_dead_reckoning():
    rig = Rig().fly_to_hover()
    rig.sim.set_gps(False)
    rig.run(4500)
    assert rig.flight.position_valid and rig.flight.active == px4.HOLD
    rig.run(1500)
    assert not rig.flight.position_valid and rig.flight.active == px4.ALTCTL and rig.flight.failsafe
    assert rig.of("GPS_RAW_INT")[-1].fix_type == 0
    rig.sim.set_gps(True)
    rig.run(200)
    assert rig.flight.position_valid


def test_without_gps_hold_does_not_arm_but_offboard_rates_do():
    rig = Rig(parameters={"SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0})
    assert rig.ask(400, 1.0) == [1]
    rig.run(100, rig.rates)
    rig.mode(6)
    assert rig.ask(400, 1.0) == [0]


def test_wind_pushes_a_level_vehicle_and_hold_leans_against_it():
    rig = Rig().fly_to_hover()
    rig.sim.set_wind((2.0, 0.0, 0.0))
    rig.run(8000)
    assert rig.sim.truth().position[0] == pytest.approx(0.0, abs=0.4)
    assert rig.of("ATTITUDE")[-1].pitch > 0.1  # facing east with the wind from behind: nose up


def test_the_magnet_holds_the_pose_in_the_boards_frame():
    rig = Rig().fly_to_hover()
    board, heading = np.array([0.0, 0.0, 1.5]), 0.3

    def pose(t):
        turn = multiply(from_euler(0.0, 0.0, heading + 0.5 * t), from_euler(0.0, -0.6, 0.0))
        return (board[0] + 2.0 * t, board[1], board[2]), turn

    relative = []
    start = rig.now
    for _ in range(250):
        p, q = pose((rig.now - start) * 1e-9)
        rig.sim.attach(p, q)
        offset = rig.sim.row[state_row.P : state_row.P + 3] - p
        relative.append(rotate((q[0], -q[1], -q[2], -q[3]), *offset))
        rig.run(4)
    assert np.ptp(relative, axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    truth = rig.sim.truth()
    assert truth.attached
    r = rig.sim.row[state_row.P : state_row.P + 3] - np.array(pose((rig.now - start) * 1e-9)[0])
    assert truth.velocity == pytest.approx(np.array([2.0, 0.0, 0.0]) + np.cross([0.0, 0.0, 0.5], r), abs=0.02)
    rig.sim.detach()
    assert not rig.sim.truth().attached


def test_at_contact_the_vehicle_takes_the_boards_velocity_at_once():
    """A sample of zero velocity in between would be a spike of hundreds of m/s^2 in every chart."""
    rig = Rig().fly_to_hover()
    level = (1.0, 0.0, 0.0, 0.0)
    p = tuple((rig.sim.row[state_row.P : state_row.P + 3] - np.array([0.0, 0.3, 0.0])).tolist())
    rig.sim.attach(p, level, rig.now, (2.0, 0.0, 0.0), 0.5)
    at_once = np.array(rig.sim.truth().velocity)
    assert at_once == pytest.approx([2.0 - 0.5 * 0.3, 0.0, 0.0], abs=1e-9)
    before = rig.sim.row[state_row.P : state_row.P + 3].copy()
    rig.run(4)
    assert rig.sim.row[state_row.P : state_row.P + 3] - before == pytest.approx(0.004 * at_once, abs=1e-5)
    assert rig.sim.truth().velocity == pytest.approx(at_once, abs=0.01)


def test_between_board_poses_the_vehicle_moves_on_with_the_board():
    rig = Rig().fly_to_hover()
    for i in range(20):
        rig.sim.attach((0.02 * i, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
        rig.run(20)  # 1 m/s, poses at 50 Hz
    x = rig.sim.row[state_row.P]
    rig.run(20)
    assert rig.sim.row[state_row.P] - x == pytest.approx(0.02, abs=1e-6)


@pytest.mark.parametrize("ahead", [0, 4_000_000])
def test_a_stamped_board_pose_is_met_at_its_time(ahead):
    rig = Rig().fly_to_hover()
    start = rig.now

    def pose(now):
        t = (now - start) * 1e-9
        return (2.0 * t, 0.0, 1.0), from_euler(0.0, 0.0, 0.8 * t)

    gaps = []
    for _ in range(100):
        p, q = pose(rig.now + ahead)
        rig.sim.attach(p, q, rig.now + ahead)
        rig.run(4)
        p, q = pose(rig.now)
        offset = rig.sim.row[state_row.P : state_row.P + 3] - p
        gaps.append(rotate((q[0], -q[1], -q[2], -q[3]), *offset))
    assert np.ptp(gaps[5:], axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)


def test_killed_vehicle_on_the_board_is_landed():
    rig = Rig().fly_to_hover()
    rig.sim.attach((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    rig.run(100)
    before = rig.sim.row[state_row.P : state_row.P + 3].copy()
    assert rig.ask(400, 0.0, 21196.0) == [0]
    rig.run(2000)
    assert rig.sim.row[state_row.P : state_row.P + 3] == pytest.approx(before)
    assert rig.flight.landed


def test_vehicle_tips_over_with_a_dead_motor():
    rig = Rig().fly_to_hover()
    rig.sim.fail_motor(2)
    rig.run(500)
    assert angle_between(tuple(rig.sim.row[state_row.Q : state_row.Q + 4]), (1.0, 0.0, 0.0, 0.0)) > 0.5
    with pytest.raises(ValueError, match="motor 4"):
        rig.sim.fail_motor(4)


def test_heartbeat_can_be_switched_off():
    rig = Rig()
    rig.sim.set_heartbeat(False)
    rig.run(3000)
    assert rig.of("HEARTBEAT") == [] and len(rig.of("ATTITUDE")) > 250
    rig.sim.set_heartbeat(True)
    rig.run(1004)
    assert len(rig.of("HEARTBEAT")) == 1


def test_vehicle_on_the_ground_stays_at_its_start():
    rig = Rig(position=(3.0, -2.0, 0.15), yaw=1.0)
    truth = rig.sim.truth()
    assert truth.position == pytest.approx((3.0, -2.0, 0.15)) and not np.any(truth.velocity)
    m = rig.of("LOCAL_POSITION_NED") or (rig.run(100) or rig.of("LOCAL_POSITION_NED"))
    assert (m[-1].x, m[-1].y, m[-1].z) == pytest.approx((-2.0, 3.0, -0.15), abs=0.05)
    imu = rig.of("HIGHRES_IMU")[-1]
    assert imu.zacc == pytest.approx(-GRAVITY, abs=0.4)


def test_the_paper_quadrotor_takes_off_and_holds_tightly():
    rig = Rig(frame="paper_quad", position=(-3.0, 1.0, 0.1)).fly_to_hover()
    rig.run(3000)
    assert rig.sim.truth().position == pytest.approx((-3.0, 1.0, 2.6), abs=0.15)
    assert rig.flight.control[control.MODE] == control.POSITION


def test_a_randomised_plant_still_hovers():
    row = load_airframe("paper_quad").params_row()
    row[0] *= 1.3
    row[9] *= 1.3 * 0.85
    rig = Rig(frame="paper_quad", params_row=row).fly_to_hover()
    rig.run(3000)
    assert rig.sim.truth().position[2] == pytest.approx(2.5, abs=0.2)


def test_same_seed_gives_the_same_bytes():
    def bytes_of(seed):
        rig = Rig(ready=False, seed=seed)
        rig.run(1500)
        return b"".join(f.raw for _, f in rig.log)

    assert bytes_of(1) == bytes_of(1)
    assert bytes_of(1) != bytes_of(2)


def test_invalid_start_raises():
    with pytest.raises(ValueError, match="finite"):
        Rig(position=(NAN, 0.0, 0.0))
