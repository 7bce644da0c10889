"""Commands and their answers, arming, modes: one test a measured row."""

import math

import pytest

from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
DENIED_CHUNKS = ["Arming denied: Resolve system health failures firs", "t\t"]


@pytest.fixture
def ready():
    return Rig()


def hover():
    return Rig().fly_to_hover()


def heartbeat(rig):
    rig.run(1004)
    m = rig.of("HEARTBEAT")[-1]
    return m.base_mode, m.custom_mode, m.system_status


def test_boot_uninit_then_standby_with_the_prearm_bit():
    rig = Rig(ready=False)
    rig.run(3900)
    assert heartbeat(rig)[2] in (0, 3)
    first = rig.of("HEARTBEAT")[0]
    assert (first.base_mode, first.custom_mode, first.system_status) == (0x1D, px4.HOLD, 0)
    healthy = [
        ms for ms, f in rig.log if f.name == "SYS_STATUS" and f.fields.onboard_control_sensors_health & px4.PREARM_CHECK
    ]
    rig.run(700)
    assert heartbeat(rig) == (0x1D, px4.HOLD, 3)
    assert all(4100 <= ms <= 5304 for ms in healthy)


def test_arming_before_ready_is_refused_with_two_chunks_and_silently_at_first():
    rig = Rig(ready=False)
    rig.run(900)
    assert rig.ask(400, 1.0) == [REJECTED] and rig.texts() == []
    rig.run(1100)
    assert rig.ask(400, 1.0) == [REJECTED]
    chunks = rig.of("STATUSTEXT")
    assert [c.text for c in chunks] == DENIED_CHUNKS
    assert [c.chunk_seq for c in chunks] == [0, 1] and chunks[0].id == chunks[1].id
    assert {c.severity for c in chunks} == {2}


def test_force_arming_does_not_skip_checks(ready):
    assert ready.mode(6) == [ACCEPTED, ACCEPTED]  # OFFBOARD without a stream: the mode changes all the same
    assert heartbeat(ready) == (0x01, px4.OFFBOARD, 0)
    assert ready.ask(400, 1.0, 21196.0) == [REJECTED]
    assert ready.texts() == DENIED_CHUNKS


def test_arm_and_disarm_and_their_repetition(ready):
    assert ready.ask(400, 0.0) == [ACCEPTED]
    assert ready.ask(400, 1.0) == [ACCEPTED]
    assert ready.texts() == ["Armed by external command\t"]
    assert ready.ask(400, 1.0) == [ACCEPTED]
    assert heartbeat(ready) == (0x9D, px4.HOLD, 4)
    assert ready.ask(400, 0.0) == [ACCEPTED]
    assert not ready.flight.armed


def test_commands_are_judged_within_ten_milliseconds(ready):
    ready.command(400, 1.0)
    ready.run(16)
    assert ready.answers() == [ACCEPTED]


def test_an_armed_vehicle_that_stays_disarms_after_ten_seconds(ready):
    ready.ask(400, 1.0)
    ready.run(9900)
    assert ready.flight.armed
    ready.run(200)
    assert not ready.flight.armed
    assert ready.texts()[-1] == "Disarmed by auto preflight disarming\t"


def test_an_unsupported_arm_parameter_gets_a_text_and_no_answer(ready):
    assert ready.ask(400, 2.0) == []
    assert ready.texts() == ["Unsupported ARM_DISARM param: 2.000\t"]


def test_arming_by_command_int(ready):
    ready.send("COMMAND_INT", 1, 1, 0, 400, 0, 0, 1.0, 0.0, NAN, NAN, 0, 0, NAN)
    ready.run(24)
    assert ready.answers() == [ACCEPTED] and ready.flight.armed


@pytest.mark.parametrize("main", [1, 2, 3, 5, 7])
def test_manual_modes_need_rc(ready, main):
    assert ready.mode(main) == [ACCEPTED, ACCEPTED]
    assert ready.ask(400, 1.0) == [REJECTED]
    if main == 3:
        assert heartbeat(ready) == (0x51, px4.POSCTL, 0)


def test_an_unknown_main_mode_is_accepted_and_changes_nothing(ready):
    assert ready.mode(99) == [ACCEPTED, ACCEPTED]
    assert ready.flight.active == px4.HOLD


def test_an_unknown_auto_mode_is_rejected_by_the_second_answer(ready):
    assert ready.mode(4, 99) == [ACCEPTED, REJECTED]
    assert ready.texts() == ["Unsupported auto mode\t"]


def test_first_answer_to_a_mode_is_accepted_and_the_second_is_the_result():
    rig = hover()
    assert rig.mode(6) == [ACCEPTED, REJECTED]
    assert "".join(rig.texts()) == "Switching to Offboard is currently not available\t"
    assert rig.mode(3) == [ACCEPTED, REJECTED]
    assert rig.flight.active == px4.HOLD
    assert rig.mode(4, 6) == [ACCEPTED, ACCEPTED]
    assert rig.flight.active == px4.LAND


def test_set_mode_message_gets_one_answer(ready):
    ready.send("SET_MODE", 1, 1, px4.OFFBOARD)
    ready.run(24)
    assert ready.answers() == [ACCEPTED] and ready.flight.active == px4.OFFBOARD


def test_disarming_in_the_air_needs_force_and_the_vehicle_falls():
    rig = hover()
    assert rig.ask(400, 0.0) == [REJECTED]
    assert rig.texts() == ["Disarming denied: not landed\t"]
    before = rig.sim.truth().velocity[2]
    assert rig.ask(400, 0.0, 21196.0, ms=104) == [ACCEPTED]
    assert rig.of("SERVO_OUTPUT_RAW")[-1][2:6] == (900, 900, 900, 900)
    assert rig.sim.truth().velocity[2] - before < -0.4
    rig.run(2500)
    assert rig.sim.truth().position[2] == 0.0
    assert heartbeat(rig)[0] == 0x1D


def test_takeoff_while_disarmed_only_changes_the_mode(ready):
    assert ready.ask(22, *(NAN,) * 7) == [ACCEPTED]
    ready.run(3000)
    assert ready.flight.active == px4.TAKEOFF and not ready.flight.armed
    assert ready.sim.truth().position[2] == 0.0


def test_takeoff_climbs_to_its_parameter_and_holds():
    rig = Rig(parameters={"MIS_TAKEOFF_ALT": 4.0})
    rig.ask(400, 1.0)
    assert rig.ask(22, *(NAN,) * 7) == [ACCEPTED]
    assert "Using default takeoff altitude: 4.0 m\t" in rig.texts()
    rig.run(14000)
    assert rig.flight.active == px4.HOLD
    assert rig.sim.truth().position[2] == pytest.approx(4.0, abs=0.2)


def test_land_from_hover_lands_and_disarms():
    rig = hover()
    assert rig.ask(21, 0.0, 0.0, 0.0, NAN, NAN, NAN, NAN) == [ACCEPTED]
    rig.run(11000)
    assert rig.texts() == ["Landing at current position\t", "Landing detected\t", "Disarmed by landing\t"]
    assert heartbeat(rig) == (0x1D, px4.HOLD, 3)


def test_return_from_afar_climbs_first():
    rig = Rig(parameters={"RTL_RETURN_ALT": 8.0, "RTL_MIN_DIST": 3.0}).fly_to_hover()
    rig.run(6000, lambda: rig.goto(6.0, 0.0, -2.5), 40)
    rig.mode(6)
    rig.run(7000, lambda: rig.goto(6.0, 0.0, -2.5), 40)
    assert rig.sim.truth().position[1] == pytest.approx(6.0, abs=0.5)
    assert rig.ask(20) == [ACCEPTED]
    rig.run(2500)
    assert rig.sim.truth().position[2] > 5.0 and rig.sim.truth().position[1] > 5.0
    rig.run(32000)
    assert not rig.flight.armed
    assert math.hypot(*rig.sim.truth().position[:2]) < 2.5


def test_termination_cannot_be_undone():
    rig = Rig()
    assert rig.ask(185, 1.0) == [REJECTED]
    rig.fly_to_hover()
    assert rig.ask(185, 1.0) == [ACCEPTED]
    assert rig.texts() == ["Failsafe activated\t"]
    assert rig.mode(4, 3) == [ACCEPTED, REJECTED]
    rig.run(6000)
    assert rig.sim.truth().position[2] == 0.0
    assert rig.ask(400, 1.0) in ([REJECTED], [ACCEPTED])
    rig.ask(400, 0.0)
    assert rig.ask(400, 1.0) == [REJECTED]
    assert "Preflight Fail: Flight termination active\t" in rig.texts()


@pytest.mark.parametrize("number", [31999, 9])
def test_unknown_commands_are_unsupported(ready, number):
    assert ready.ask(number) == [UNSUPPORTED]


def test_reboot_is_denied(ready):
    assert ready.ask(246, 1.0) == [DENIED]


@pytest.mark.parametrize("to", [{"system": 7}, {"component": 5}, {"component": 190}])
def test_commands_for_other_systems_get_no_answer(ready, to):
    assert ready.ask(400, 1.0, **to) == []
    assert not ready.flight.armed and ready.sim.rejected["ignored_frames"] > 0


@pytest.mark.parametrize("id", [148, 300, 242, 397, 435, 264, 49, 0])
def test_requested_messages_come_before_their_answer(ready, id):
    ready.run(8 - ready.ms % 8)
    ready.log.clear()
    ready.command(512, float(id))
    ready.run(8)
    names = [(f.id, f.name) for _, f in ready.log]
    ids = [i for i, _ in names]
    assert id in ids and ids.index(id) < ids.index(77)
    assert ready.answers() == [ACCEPTED]


@pytest.mark.parametrize("id", [436, 259, 9999])
def test_requests_for_unsupported_messages_are_denied(ready, id):
    assert ready.ask(512, float(id)) == [DENIED]


def test_autopilot_version_is_that_of_v1_17(ready):
    assert ready.ask(520, 1.0) == [ACCEPTED]
    (version,) = ready.of("AUTOPILOT_VERSION")
    assert (version.capabilities, version.flight_sw_version) == (59647, 0x011100FF)
    assert version.uid == 5283920058631409231
    assert ready.ask(519, 1.0) == [ACCEPTED]
    (protocol,) = ready.of("PROTOCOL_VERSION")
    assert (protocol.version, protocol.min_version, protocol.max_version) == (200, 100, 203)


def test_a_mavlink_1_frame_is_answered_in_mavlink_2(ready):
    message = px4.mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    ready.wire.send(bytes(message.pack(px4.mavlink.MAVLink(None, 245, 190), force_mavlink1=True)))
    ready.run(24)
    (answer,) = [f for _, f in ready.log if f.name == "COMMAND_ACK"]
    assert answer.raw[0] == 0xFD and answer.fields.result == ACCEPTED
