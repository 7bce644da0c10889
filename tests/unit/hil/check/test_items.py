"""The automatic checks on simulated devices: a healthy rig passes, and each fault is seen by the item meant for it."""

import functools
import math
from dataclasses import replace

import pytest
from made_up import context as make_context

from groundcar.scout_params import load_scout
from groundcar.scout_sim import ScoutSim
from hil import bus_clock
from hil.bus import BusError, open_hub
from hil.check import bench_bus, bench_camera, bench_car, bench_vehicle
from hil.check.checklist import load_checklist
from hil.check.judge import Outcome, judge
from hil.check.registry import NotApplicable, Unavailable, checks
from hil.runs import write_json
from hil.view import free_port
from scenarios.spec import load
from vehicle.px4_sim import Px4Sim
from vehicle.render import Renderer

ITEMS = {
    (item.check, str(item.args.get("name", ""))): item
    for group in load_checklist("preflight").group
    for item in group.item
    if item.check
}


@pytest.fixture
def context(tmp_path):
    return make_context(tmp_path)


def result(context, check, **args):
    """The preflight item's judgement."""
    item = ITEMS[check, args.get("name", "")]
    known = checks()[check]
    return judge(known.function(context, **{**item.args, **args}), item.limits, known.unit)


def with_slot(context, slot, **changes):
    section = getattr(context.rig, slot).model_copy(update=changes)
    return replace(context, rig=context.rig.model_copy(update={slot: section}), _kept={})


HEALTHY = [key for key in ITEMS if key[0] not in ("host.bus",) and ITEMS[key].when != "real"]


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return make_context(tmp_path_factory.mktemp("out"))


@pytest.mark.parametrize("key", HEALTHY, ids=[" ".join(key).strip() for key in HEALTHY])
def test_a_healthy_simulated_rig_passes_every_item_of_the_preflight(healthy, key):
    try:
        judged = result(healthy, key[0], **({"name": key[1]} if key[1] else {}))
    except NotApplicable as error:
        assert ("built in" in str(error)) is key[0].startswith("policy.")
        assert ("no earlier flight" in str(error)) is (key[0] == "vehicle.parameters_changed")
        assert ("one clock" in str(error)) is (key[0] in ("host.clock", "host.date"))
    else:
        assert judged.outcome in (Outcome.PASS, Outcome.MARGINAL), judged


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


class _Sick(Px4Sim):
    def __init__(self, *args, **more):
        super().__init__(*args, **more)
        self.set_gps(False)


def test_a_silent_autopilot_is_unknown_and_says_so(context, monkeypatch):
    monkeypatch.setattr(bench_vehicle, "Px4Sim", _Silent)
    for name in ("vehicle.heartbeat", "vehicle.battery", "vehicle.kill"):
        with pytest.raises(Unavailable, match=r"no working link|did not reach its hover"):
            result(context, name)


def test_an_autopilot_without_position_does_not_pass_its_own_checks(context, monkeypatch):
    monkeypatch.setattr(bench_vehicle, "Px4Sim", _Sick)
    assert result(context, "vehicle.prearm").outcome is Outcome.FAIL


def test_a_slow_or_old_motion_capture_fails(context):
    assert result(with_slot(context, "mocap", rate_hz=20.0), "mocap.rate").outcome is Outcome.FAIL
    old = with_slot(context, "mocap", delay_ms=60.0)
    assert result(old, "mocap.age").outcome is Outcome.FAIL
    assert result(old, "mocap.rate").outcome is Outcome.PASS


def test_a_fence_inside_the_workspace_fails(context):
    gate = context.rig.gate.model_copy(update={"x": (-25.0, 15.0)})
    judged = result(replace(context, rig=context.rig.model_copy(update={"gate": gate})), "gate.fence")
    assert (judged.outcome, judged.margin) == (Outcome.FAIL, pytest.approx(-5.0))


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


def test_a_pressed_estop_fails_and_keeps_the_stop_from_being_tried(context, monkeypatch):
    car_with(monkeypatch, lambda sim: sim.press_estop())
    assert result(context, "car.fault").outcome is Outcome.FAIL
    with pytest.raises(Unavailable, match="e-stop"):
        result(context, "car.stop")


def test_a_car_in_the_hands_of_the_remote_control_is_not_in_can_mode(context, monkeypatch):
    car_with(monkeypatch, lambda sim: sim.set_rc((0.0, 0.0)))
    assert result(context, "car.mode").outcome is Outcome.FAIL


def test_an_old_or_silent_car_is_unknown(context, monkeypatch):
    car_with(monkeypatch, protocol=1)
    with pytest.raises(Unavailable, match="V1"):
        result(context, "car.mode")
    car_with(monkeypatch, lambda sim: sim.mute("MotionState"))
    with pytest.raises(Unavailable, match="nothing is heard"):
        result(context, "car.battery")


@pytest.mark.parametrize("scenario", ["simple-ii", "normal-i", "hard-ii"])
def test_the_camera_measures_the_boards_inclination_whatever_it_is(tmp_path, scenario):
    context = replace(make_context(tmp_path), scenario=load(scenario))
    seen = context.camera().look(2.0)
    error = math.degrees(context.drawn.camera_tilt_error)
    for picture in seen:
        assert picture.pose.found
        assert picture.distance == pytest.approx(2.0, abs=0.01)
        # what is left is the calibration's own error, and motion capture's noise
        assert abs(picture.inclination - context.scenario.board.inclination_deg) == pytest.approx(abs(error), abs=0.3)


def test_a_board_set_to_another_angle_is_seen(context):
    bench = context.camera()
    bench.look(2.0)
    bench.set_deg -= 10.0  # the scenario says another angle than the board stands at
    judged = result(context, "board.inclination")
    assert judged.outcome is Outcome.FAIL


def test_a_covered_lens_decodes_nothing(context, monkeypatch):
    class Covered(Renderer):
        def render(self, vehicle, board, exposure_ns, frame_index):
            picture = super().render(vehicle, board, exposure_ns, frame_index)
            picture[:] = 3
            return picture

    monkeypatch.setattr(bench_camera, "Renderer", Covered)
    assert result(context, "camera.decode").outcome is Outcome.FAIL
    with pytest.raises(Unavailable, match="in none of 10 pictures"):
        result(context, "board.inclination")


def test_a_long_exposure_cannot_keep_the_scenarios_rate(context):
    fast = replace(context, scenario=load("hard-i"))
    assert result(with_slot(fast, "camera", exposure_ms=25.0), "camera.mode").outcome is Outcome.FAIL


def test_a_camera_model_has_no_pictures_to_decode(context):
    with pytest.raises(NotApplicable, match="model"):
        result(with_slot(context, "camera", source="model"), "camera.decode")


def test_a_device_this_program_cannot_read_is_unknown(context):
    real = with_slot(context, "vehicle", kind="udp")
    with pytest.raises(Unavailable, match='vehicle of kind "udp"'):
        result(real, "vehicle.heartbeat")


def test_the_bus_is_tried_and_one_that_does_not_come_up_is_unknown(context, monkeypatch):
    reading = checks()["host.bus"].function(context)
    assert isinstance(reading.value, float)
    assert 0.0 < reading.value < 50.0  # a busy machine may take its time; the preflight's limit is 5 ms

    def refuse(endpoint):
        raise BusError(f"the hub cannot listen on {endpoint}")

    monkeypatch.setattr(bench_bus, "open_hub", refuse)
    with pytest.raises(Unavailable, match="cannot listen"):
        result(context, "host.bus")
    assert ITEMS["host.bus", ""].optional


def test_a_disk_that_cannot_be_written_fails_the_recorder(context, monkeypatch):
    from hil.check import items_host

    def full(*args, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(items_host, "Recorder", full)
    assert result(context, "host.recorder").outcome is Outcome.FAIL


def test_a_recorder_that_loses_messages_fails(context, monkeypatch):
    from hil.check import items_host

    class Lossy(items_host.Recorder):
        def __call__(self, now_ns, topic, message):
            if now_ns != 990_000_000:
                super().__call__(now_ns, topic, message)

    monkeypatch.setattr(items_host, "Recorder", Lossy)
    judged = result(context, "host.recorder")
    assert (judged.outcome, "4999 of 5000" in judged.reason) == (Outcome.FAIL, True)


class TestPolicy:
    @pytest.fixture
    def policy(self, tmp_path):
        onnx = pytest.importorskip("onnx")
        import numpy as np

        from policies.contract import METADATA_KEY, Contract, Provenance
        from policies.observation import OBS_DIM

        def make(**changes):
            h = onnx.helper
            weight = onnx.numpy_helper.from_array(np.zeros((OBS_DIM, 4), dtype=np.float32), "w")
            kind = onnx.TensorProto.FLOAT
            graph = h.make_graph(
                [h.make_node("MatMul", ["observation", "w"], ["action"])],
                "g",
                [h.make_tensor_value_info("observation", kind, [1, OBS_DIM])],
                [h.make_tensor_value_info("action", kind, [1, 4])],
                [weight],
            )
            model = h.make_model(graph, opset_imports=[h.make_opsetid("", 17)], ir_version=8)
            origin = Provenance(recipe="r", seed=1, samples=2)
            said = Contract(
                **{"name": "p", "stage": "vision", "airframe": "paper_quad", "provenance": origin, **changes}
            )
            h.set_model_props(model, {METADATA_KEY: said.model_dump_json()})
            onnx.save(model, tmp_path / "p.onnx")
            return replace(make_context(tmp_path), policy=str(tmp_path / "p.onnx"))

        return make

    def test_a_policy_made_for_this_rig_passes(self, policy):
        assert result(policy(), "policy.contract").outcome is Outcome.PASS

    def test_a_policy_for_another_airframe_fails(self, policy):
        judged = result(policy(airframe="crazyflie"), "policy.contract")
        assert (judged.outcome, "crazyflie" in judged.reason) == (Outcome.FAIL, True)

    def test_the_hash_can_be_demanded(self, policy):
        context = policy()
        found = checks()["policy.hash"].function(context).value
        assert result(context, "policy.hash", sha256=found).outcome is Outcome.PASS
        assert result(context, "policy.hash", sha256="0" * 64).outcome is Outcome.FAIL

    def test_a_missing_file_fails(self, tmp_path):
        context = replace(make_context(tmp_path), policy=str(tmp_path / "gone.onnx"))
        assert result(context, "policy.contract").outcome is Outcome.FAIL
        assert result(context, "policy.hash").outcome is Outcome.FAIL


def test_one_host_has_one_clock(context):
    for check in ("host.clock", "host.date"):
        with pytest.raises(NotApplicable, match="--endpoint"):
            result(context, check)


def test_the_clock_of_the_hubs_host_is_measured(context, monkeypatch):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    there = replace(context, endpoint=endpoint, _kept={})
    with pytest.raises(Unavailable, match="no hub answers"):
        result(there, "host.clock")
    monkeypatch.setattr(bus_clock, "clock_id", lambda: b"another host")
    with open_hub(endpoint):
        monkeypatch.setattr(bus_clock, "clock_id", lambda: b"this host")
        reading = checks()["host.clock"].function(there)
        assert isinstance(reading.value, float)
        assert 0.0 < reading.value < 50.0 and reading.detail.startswith("offset ")
        assert result(there, "host.date").outcome is Outcome.PASS
    far = bus_clock.Clock(10**12, 9_000_000, -2 * 10**9, False)
    there._kept["clocks"] = far
    assert result(there, "host.clock").outcome is Outcome.FAIL
    assert result(there, "host.date").outcome is Outcome.MARGINAL
    there._kept["clocks"] = far._replace(shared=True)
    assert result(there, "host.clock").outcome is Outcome.PASS
