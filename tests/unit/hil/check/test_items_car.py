"""Items of the car: each fault is seen by the item meant for it."""

import pytest

from groundcar.scout.params import load_scout
from groundcar.scout.sim import ScoutSim
from hil.bench import car as bench_car
from hil.bench.reading import Unavailable
from hil.check.judge import Outcome
from tests.unit.hil.check.preflight import result


def car_with(monkeypatch, prepare=lambda sim: None, **changes):
    def make(*args, **more):
        sim = ScoutSim(*args, **{**more, **changes})
        prepare(sim)
        return sim

    monkeypatch.setattr(bench_car, "ScoutSim", make)


def test_a_car_whose_watchdog_is_slow_fails_the_stop(context, monkeypatch):
    scout = load_scout()
    slow = scout.model_copy(update={"protocol": scout.protocol.model_copy(update={"watchdog": 1.2})})
    car_with(monkeypatch, params=slow)
    judged = result(context, "car.stop")
    assert judged.outcome is Outcome.FAIL
    assert judged.margin is not None
    assert judged.margin < -0.4


def test_a_car_that_never_stops_fails(context, monkeypatch):
    scout = load_scout()
    never = scout.model_copy(update={"protocol": scout.protocol.model_copy(update={"watchdog": 100.0})})
    car_with(monkeypatch, params=never)
    judged = result(context, "car.stop")
    assert (judged.outcome, "still driving" in judged.reason) == (Outcome.FAIL, True)


def test_pressed_estop_fails_and_the_stop_test_is_not_run(context, monkeypatch):
    car_with(monkeypatch, lambda sim: sim.press_estop())
    assert result(context, "car.fault").outcome is Outcome.FAIL
    with pytest.raises(Unavailable, match="e-stop"):
        result(context, "car.stop")


def test_car_under_remote_control_is_not_in_can_mode(context, monkeypatch):
    car_with(monkeypatch, lambda sim: sim.set_rc((0.0, 0.0)))
    assert result(context, "car.mode").outcome is Outcome.FAIL


def test_car_with_old_protocol_or_no_frames_is_unknown(context, monkeypatch):
    car_with(monkeypatch, protocol=1)
    with pytest.raises(Unavailable, match="V1"):
        result(context, "car.mode")
    car_with(monkeypatch, lambda sim: sim.mute("MotionState"))
    with pytest.raises(Unavailable, match="no frames come from the car"):
        result(context, "car.battery")


def test_curve_is_measured_by_the_wheels(context):
    moved, turned = context.car().try_curve(0.2, 0.6)
    assert 0.1 < moved < 0.5
    assert 0.3 < turned < 1.5
    assert abs(context.car().feedback.speed) < 0.02
