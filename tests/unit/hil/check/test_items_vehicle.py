"""Items of the vehicle, its fence and motion capture: each fault is seen by the item meant for it."""

import functools
import math
from dataclasses import replace

import pytest

from hil.bench import vehicle as bench_vehicle
from hil.bench.reading import NotApplicable, Unavailable
from hil.check.catalogue import checks
from hil.check.judge import Outcome
from hil.recording.runs import write_json
from tests.unit.hil.check.preflight import result, with_slot
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.px4.sim.messages import UID


def test_parameters_are_compared_with_the_last_flight_of_this_rig(context):
    check = "vehicle.parameters_changed"
    with pytest.raises(NotApplicable, match="no earlier flight of rig sim"):
        result(context, check)
    parameters = {"COM_OF_LOSS_T": 0.3, "FD_FAIL_P": 60}
    flown = context.out / "20260102T030405Z_simple-i_sim-seed0"
    flown.mkdir()
    write_json(flown / "manifest.json", {"rig": {"name": "sim"}, "autopilot": {"parameters": parameters}})
    assert result(context, check).outcome is Outcome.PASS
    changed = {**parameters, "FD_FAIL_P": 45, "OLD_NAME": 2}
    write_json(flown / "manifest.json", {"rig": {"name": "sim"}, "autopilot": {"parameters": changed}})
    reading = checks()[check].function(context)
    assert reading.value == 2 and "FD_FAIL_P 45, now 60; OLD_NAME 2, now gone" in reading.detail
    assert result(context, check).outcome is Outcome.MARGINAL


def test_measured_failsafe_times_are_those_of_the_parameters(healthy):
    trial = healthy.trial()
    assert trial.loss_s is not None
    assert 0.3 <= trial.loss_s <= 0.3 + 0.2  # COM_OF_LOSS_T as the driver sets it, and PX4's hysteresis
    assert trial.loss_mode == "AUTO.LAND"
    assert trial.kill_s is not None
    assert trial.motors_off_s is not None
    assert trial.kill_s < trial.motors_off_s < 0.25


def test_a_lost_stream_that_is_tolerated_too_long_fails(context, monkeypatch):
    slow = functools.partial(bench_vehicle.LinkConfig, parameters={"COM_OF_LOSS_T": 1.5, "COM_OBL_RC_ACT": 4})
    monkeypatch.setattr(bench_vehicle, "LinkConfig", slow)
    assert result(context, "vehicle.offboard_loss").outcome is Outcome.FAIL
    assert result(context, "vehicle.parameter", name="COM_OF_LOSS_T").outcome is Outcome.FAIL


def sim_with(monkeypatch, **changes):
    monkeypatch.setattr(bench_vehicle, "Px4Sim", functools.partial(Px4Sim, **changes))


def test_a_failure_detector_tighter_than_the_board_fails(context, monkeypatch):
    sim_with(monkeypatch, parameters={"CBRK_FLIGHTTERM": 0})
    judged = result(context, "vehicle.tilt_limit")
    assert judged.outcome is Outcome.FAIL
    assert "75" in judged.reason


def test_parameters_of_another_firmware_are_unknown(context):
    with pytest.raises(Unavailable, match="NO_SUCH_PARAM"):
        result_of = checks()["vehicle.parameter"].function
        result_of(context, name="NO_SUCH_PARAM")


class _Silent(Px4Sim):
    def step(self, now_ns):
        pass


class _WithoutGps(Px4Sim):
    def __init__(self, *args, **more):
        super().__init__(*args, **more)
        self.set_gps(False)


def test_silent_autopilot_is_unknown_with_the_reason(context, monkeypatch):
    monkeypatch.setattr(bench_vehicle, "Px4Sim", _Silent)
    for name in ("vehicle.heartbeat", "vehicle.battery", "vehicle.kill"):
        with pytest.raises(Unavailable, match=r"no working link|did not reach its hover"):
            result(context, name)


def test_an_autopilot_without_position_does_not_pass_its_own_checks(context, monkeypatch):
    monkeypatch.setattr(bench_vehicle, "Px4Sim", _WithoutGps)
    assert result(context, "vehicle.prearm").outcome is Outcome.FAIL


def test_slow_or_delayed_motion_capture_fails(context):
    assert result(with_slot(context, "mocap", rate_hz=20.0), "mocap.rate").outcome is Outcome.FAIL
    old = with_slot(context, "mocap", delay_ms=60.0)
    assert result(old, "mocap.age").outcome is Outcome.FAIL
    assert result(old, "mocap.rate").outcome is Outcome.PASS


def test_a_fence_inside_the_workspace_fails(context):
    gate = context.rig.gate.model_copy(update={"x": (-25.0, 15.0)})
    judged = result(replace(context, rig=context.rig.model_copy(update={"gate": gate})), "gate.fence")
    assert (judged.outcome, judged.margin) == (Outcome.FAIL, pytest.approx(-5.0))


def test_autopilot_is_named_and_another_one_than_the_list_wants_fails(context):
    uid = f"{UID:016x}"
    reading = checks()["vehicle.identity"].function(context)
    assert (reading.value, reading.ok) == (uid, True)
    assert "1.17.0" in reading.detail
    assert checks()["vehicle.identity"].function(context, uid="4954").ok is False


def test_autopilot_without_a_uid_is_unknown(context, monkeypatch):
    monkeypatch.setattr("vehicle.px4.sim.messages.UID", 0)
    with pytest.raises(Unavailable, match="does not tell its UID"):
        checks()["vehicle.identity"].function(context)


def test_another_autopilot_in_the_same_session_is_unknown(context, monkeypatch):
    checks()["vehicle.identity"].function(context)
    context.forget()
    monkeypatch.setattr("vehicle.px4.sim.messages.UID", 7)
    with pytest.raises(Unavailable, match="another autopilot answers: UID 0000000000000007"):
        checks()["vehicle.identity"].function(context)


def test_go_of_a_real_autopilot_holds_all_that_was_read_of_it(context):
    result(context, "vehicle.parameter", name="COM_OF_LOSS_T")
    assert context.autopilot() == {}, "a simulated one is bound to nothing"
    result(context, "vehicle.tilt_limit")
    context.forget()  # the failed items are tried again
    checks()["vehicle.parameter"].function(context, name="GF_MAX_HOR_DIST")
    real = with_slot(context, "vehicle", kind="mavlink", url="udp://:14540")
    real._kept.update(context._kept)
    real._parameters.update(context._parameters)
    real._reported_s = math.inf
    table = real.autopilot()
    assert table["uid"] == f"{UID:016x}"
    held = table["parameters"]
    assert {"COM_OF_LOSS_T", "COM_OBL_RC_ACT", "FD_FAIL_P", "CBRK_FLIGHTTERM", "GF_MAX_HOR_DIST"} <= set(held)
    assert held["COM_OF_LOSS_T"] == pytest.approx(0.3)
