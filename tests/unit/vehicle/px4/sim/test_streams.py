"""Streams, intervals, time, parameters, garbage, texts: the API link as a client sees it."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.vehicle.px4.sim.client import Rig
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.params import INT32, REAL32, Parameters
from vehicle.px4.sim.streams import TABLE

FAILED = 4


@pytest.fixture
def ready():
    return Rig()


def as_float(value):
    return struct.unpack("<f", struct.pack("<i", value))[0]


def test_default_rates_on_both_links():
    rig = Rig(gcs=True)
    rig.gcs_log.clear()
    rig.run(10_000)
    for log, link in ((rig.log, "api_hz"), (rig.gcs_log, "gcs_hz")):
        for name, row in TABLE.items():
            count = sum(f.name == name for _, f in log)
            hz = 0.0 if name.startswith(("POSITION_TARGET_GLOBAL", "ORBIT")) else float(getattr(row, link))
            assert count == pytest.approx(10 * hz, abs=1), name


def test_intervals_can_be_set_stopped_restored_and_read(ready):
    assert ready.ask(511, 331.0, 10_000.0) == [0]
    ready.log.clear()
    ready.run(2000)
    assert len(ready.of("ODOMETRY")) == pytest.approx(200, abs=1)
    assert ready.ask(510, 331.0) == [0]
    assert ready.of("MESSAGE_INTERVAL")[-1][:2] == (331, 10_000) or ready.of("MESSAGE_INTERVAL")[-1][1] == 10_000
    assert ready.ask(511, 331.0, -1.0) == [0]
    ready.log.clear()
    ready.run(1000)
    assert ready.of("ODOMETRY") == []
    assert ready.ask(511, 331.0, 0.0) == [0]
    ready.log.clear()
    ready.run(2000)
    assert len(ready.of("ODOMETRY")) == pytest.approx(60, abs=1)


def test_the_fastest_stream_is_a_little_below_the_loop(ready):
    assert ready.ask(511, 30.0, 4000.0) == [0]
    ready.log.clear()
    ready.run(2000)
    assert len(ready.of("ATTITUDE")) / 2 == pytest.approx(223, abs=3)


@pytest.mark.parametrize("id", [0, 9999])
def test_interval_of_an_unsupported_message_fails(ready, id):
    assert ready.ask(511, float(id), 10_000.0) == [FAILED]


@pytest.mark.parametrize("interval", [math.inf, -math.inf, math.nan])
def test_interval_that_is_not_finite_fails_and_changes_nothing(ready, interval):
    assert ready.ask(511, 30.0, interval) == [FAILED]
    ready.log.clear()
    ready.run(1000)
    assert len(ready.of("ATTITUDE")) == pytest.approx(100, abs=2)


def test_interval_beyond_the_reported_range_is_reported_as_the_largest(ready):
    assert ready.ask(511, 30.0, 3.0e38) == [0]
    assert ready.ask(510, 30.0) == [0]
    assert ready.of("MESSAGE_INTERVAL")[-1].interval_us == 2**31 - 1


def test_ground_truth_on_request_has_no_time(ready):
    assert ready.ask(511, 115.0, 10_000.0) == [0]
    ready.log.clear()
    ready.run(1000)
    truth = ready.of("HIL_STATE_QUATERNION")
    assert len(truth) == pytest.approx(100, abs=1) and {m.time_usec for m in truth} == {0}
    assert truth[-1].zacc == pytest.approx(0, abs=2)


def test_odometry_has_velocity_in_ned_and_nan_off_the_diagonal():
    rig = Rig(yaw=0.0).fly_to_hover()
    rig.run(300)
    m = rig.of("ODOMETRY")[-1]
    assert (m.frame_id, m.child_frame_id, m.estimator_type, m.quality) == (1, 1, 8, 0)
    finite = [i for i, v in enumerate(m.pose_covariance) if math.isfinite(v)]
    assert finite == [0, 6, 11, 15, 18, 20]
    truth = rig.sim.truth()
    assert (m.x, m.y, m.z) == pytest.approx((truth.position[1], truth.position[0], -truth.position[2]), abs=0.05)
    assert m.q[0] == pytest.approx(math.sqrt(0.5), abs=0.02) and m.q[3] == pytest.approx(math.sqrt(0.5), abs=0.02)


def test_timesync_is_answered_with_garbage_targets_and_sent_unasked(ready):
    ready.send("TIMESYNC", 0, 123456789, 0, 0)
    ready.run(4)
    (answer,) = [m for m in ready.of("TIMESYNC") if m.ts1 == 123456789]
    assert answer.tc1 == ready.sim.boot_ns and (answer.target_system, answer.target_component) == (32, 137)
    ready.log.clear()
    ready.run(1000)
    own = ready.of("TIMESYNC")
    assert len(own) == 10 and all(m.tc1 == 0 for m in own)
    last = own[-1].ts1
    ready.send("TIMESYNC", last + 5_000_000_000, last, 0, 0)
    ready.run(4)
    assert ready.sim.receiver.timesync_offset_ns == pytest.approx(5_000_000_000, abs=50_000_000)


def test_ping_is_answered_to_its_sender(ready):
    ready.send("PING", 77, 3, 0, 0)
    ready.run(4)
    assert [m for m in ready.of("PING") if m.target_system] == [(77, 3, 245, 190)]


def test_a_parameter_is_echoed_at_once_and_again_on_all_links():
    rig = Rig(gcs=True)
    rig.run(500)
    rig.log.clear()
    rig.gcs_log.clear()
    rig.send("PARAM_SET", 1, 1, "COM_OF_LOSS_T", 0.5, REAL32)
    rig.run(4)
    assert [(m.param_id, m.param_value) for m in rig.of("PARAM_VALUE")] == [("COM_OF_LOSS_T", 0.5)]
    rig.run(24)
    assert len(rig.of("PARAM_VALUE")) == 2
    assert [f.fields.param_value for _, f in rig.gcs_log if f.name == "PARAM_VALUE"] == [0.5]
    rig.send("PARAM_SET", 1, 1, "COM_OF_LOSS_T", 0.5, REAL32)
    rig.run(40)
    assert len(rig.of("PARAM_VALUE")) == 3  # unchanged: only the echo


def test_integer_parameters_are_encoded_bytewise_in_the_float(ready):
    ready.run(300)
    ready.log.clear()
    ready.send("PARAM_SET", 1, 1, "COM_OBL_RC_ACT", as_float(4), INT32)
    ready.run(4)
    (frame,) = [f for _, f in ready.log if f.name == "PARAM_VALUE"]
    assert frame.payload[:4] == struct.pack("<i", 4) and frame.fields.param_type == INT32
    assert ready.flight.parameters["COM_OBL_RC_ACT"] == 4


@pytest.mark.parametrize(
    ("name", "kind"), [("COM_OBL_RC_ACT", REAL32), ("COM_OBL_RC_ACT", 4), ("NO_SUCH_PARAM", REAL32)]
)
def test_param_set_with_wrong_type_or_name_gets_no_answer(ready, name, kind):
    ready.run(300)
    ready.log.clear()
    ready.send("PARAM_SET", 1, 1, name, 1.0, kind)
    ready.send("PARAM_REQUEST_READ", 1, 1, "NO_SUCH_PARAM", -1)
    ready.send("PARAM_REQUEST_READ", 1, 1, "", 900)
    ready.run(40)
    assert ready.of("PARAM_VALUE") == []


def test_parameters_are_set_without_range_check_and_read_by_name_and_index(ready):
    ready.run(300)
    ready.log.clear()
    ready.send("PARAM_SET", 1, 1, "COM_OF_LOSS_T", 9999.0, REAL32)
    ready.run(30)
    index = Parameters().index("COM_OF_LOSS_T")
    ready.log.clear()
    ready.send("PARAM_REQUEST_READ", 1, 1, "COM_OF_LOSS_T", -1)
    ready.send("PARAM_REQUEST_READ", 1, 1, "", index)
    ready.run(4)
    assert [(m.param_value, m.param_index, m.param_count) for m in ready.of("PARAM_VALUE")] == [
        (9999.0, index, 887)
    ] * 2


@settings(max_examples=40)
@given(st.integers(-(2**31), 2**31 - 1))
def test_any_integer_survives_the_float_field(value):
    parameters = Parameters()
    parameters.set_wire("COM_OBL_RC_ACT", INT32, struct.pack("<i", value))
    assert parameters.wire("COM_OBL_RC_ACT") == struct.pack("<i", value)


def test_unknown_boot_parameters_are_an_error():
    with pytest.raises(ValueError, match="COM_OFF_LOSS"):
        Rig(parameters={"COM_OFF_LOSS": 1.0})


def test_gains_set_over_the_wire_reach_the_loop(ready):
    ready.send("PARAM_SET", 1, 1, "MC_ROLLRATE_P", 0.3, REAL32)
    ready.run(8)
    assert ready.flight.params[16] == pytest.approx(0.3)


@settings(max_examples=25)
@given(st.lists(st.binary(max_size=80), max_size=8))
def test_invalid_bytes_are_counted_and_ignored_by_px4(chunks):
    rig = Rig(ready=False)
    for chunk in chunks:
        rig.wire.send(chunk)
        rig.run(4)
    rig.send("PING", 1, 1, 0, 0)
    rig.run(400)
    for _ in range(4):  # what looked like the start of a frame has been swept out by now
        rig.send("PING", 1, 1, 0, 0)
    rig.run(8)
    assert any(m.target_system == 245 for m in rig.of("PING"))


def test_unparsed_bytes_are_counted():
    rig = Rig(ready=False)
    rig.wire.send(b"\x01\x02garbage")
    rig.run(8)
    assert rig.sim.rejected["garbage_bytes"] == 9


def test_battery_drains_while_armed_and_recovers():
    rig = Rig().fly_to_hover()
    rig.run(1000)
    flying = rig.of("SYS_STATUS")[-1]
    assert 15300 < flying.voltage_battery < 16100 and flying.battery_remaining < 90
    rig.ask(400, 0.0, 21196.0)
    rig.run(8000)
    assert rig.of("SYS_STATUS")[-1].voltage_battery == 16200


def test_required_floats_sent_in_flight_are_finite():
    rig = Rig().fly_to_hover()
    rig.run(500)
    for name in ("ATTITUDE", "LOCAL_POSITION_NED", "HIGHRES_IMU", "ATTITUDE_QUATERNION"):
        for m in rig.of(name):
            assert np.isfinite([v for v in m if isinstance(v, (int, float))]).all()


def test_px4_without_wires_sends_no_streams():
    rig = Rig(ready=False)
    assert set(rig.sim.ports) == {"api"}
    with pytest.raises(ValueError, match="payload"):
        type(rig.sim)({"payload": None}, None)  # type: ignore[arg-type]
    assert px4.mode_name(rig.flight.active) == "AUTO.LOITER"
