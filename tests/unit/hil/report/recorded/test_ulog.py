"""PX4's own log: whole, damaged, and no log at all."""

import struct

import numpy as np
import pytest

from hil.report.recorded.ulog import ULogError, read_ulog
from tests.paths import FIRMWARE_RUN

LOG = FIRMWARE_RUN / "firmware.ulg"


def message(kind, payload):
    return struct.pack("<HB", len(payload), ord(kind)) + payload


HEADER = LOG.read_bytes()[:16]


def test_real_log_tells_firmware_rates_parameters_and_events_in_words():
    log = read_ulog(LOG)
    assert log.faults == [] and log.firmware.startswith("PX4 1.17.0 (")
    gyro = log.topics["vehicle_angular_velocity"]
    assert gyro.hz > 20.0 and np.isfinite(gyro.vector("xyz", 3)).all() and np.diff(gyro.us).min() > 0
    assert len(log.parameters) > 500
    value, default = log.not_default["MPC_THR_HOVER"]
    assert value != default and 0.0 < value < 1.0
    assert {level for _, level, _ in log.texts} <= {"info", "notice", "warning", "error", "critical", "debug"}
    assert any("rmed" in text or "isarm" in text for _, _, text in log.texts)


def test_field_that_this_firmware_lacks_is_not_a_number():
    gyro = read_ulog(LOG).topics["vehicle_angular_velocity"]
    assert np.isnan(gyro["no_such_field"]).all() and gyro["no_such_field"].shape == gyro.us.shape


def test_log_that_is_cut_off_says_so_and_gives_what_is_there(tmp_path, capsys):
    cut = tmp_path / "cut.ulg"
    data = LOG.read_bytes()
    cut.write_bytes(data[: len(data) * 3 // 5])
    whole, log = read_ulog(LOG), read_ulog(cut)
    assert any("cut off" in fault for fault in log.faults)
    assert 0 < len(log.topics["vehicle_angular_velocity"].us) < len(whole.topics["vehicle_angular_velocity"].us)
    assert log.parameters == whole.parameters
    assert capsys.readouterr().out == ""


def test_log_that_is_damaged_inside_says_so(tmp_path, capsys):
    data = bytearray(LOG.read_bytes())
    at = len(data) * 3 // 4
    data[at : at + 300] = bytes(300)
    broken = tmp_path / "broken.ulg"
    broken.write_bytes(data)
    log = read_ulog(broken)
    assert any("damaged" in fault for fault in log.faults)
    assert len(log.topics["vehicle_angular_velocity"].us) > 20
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("data", [b"", b"ULog", b"\x89PNG\r\n\x1a\n" + bytes(100), b"x" * 1000])
def test_other_files_are_refused_in_one_line(tmp_path, data):
    path = tmp_path / "other.ulg"
    path.write_bytes(data)
    with pytest.raises(ULogError, match=r"is no log of PX4") as refused:
        read_ulog(path)
    assert "\n" not in str(refused.value)


def test_log_without_anything_in_it_is_refused(tmp_path):
    path = tmp_path / "empty.ulg"
    path.write_bytes(HEADER)
    with pytest.raises(ULogError, match="nothing that can be read"):
        read_ulog(path)


@pytest.mark.parametrize(
    "formats",
    [
        [b"vehicle_status:uint64_t timestamp;float[999999999] x;"],
        [b"vehicle_status:uint64_t timestamp;a[900] x;", b"a:b[900] x;", b"b:float[900] x;"],
        [b"vehicle_status:uint64_t timestamp;vehicle_status x;"],
    ],
)
def test_format_of_endless_size_is_left_out(tmp_path, formats):
    path = tmp_path / "endless.ulg"
    parameter = message("P", bytes([len(b"float A")]) + b"float A" + struct.pack("<f", 1.5))
    add = message("A", struct.pack("<BH", 0, 1) + b"vehicle_status")
    path.write_bytes(HEADER + b"".join(message("F", one) for one in formats) + parameter + add)
    log = read_ulog(path)
    assert log.parameters == {"A": 1.5} and any("vehicle_status" in fault for fault in log.faults)


@pytest.mark.timeout(60)
def test_log_that_ends_in_a_damaged_header_is_not_read_for_ever(tmp_path):
    path = tmp_path / "loop.ulg"
    path.write_bytes(HEADER + struct.pack("<HB", 20_000, 0) + b"xx")
    with pytest.raises(ULogError):
        read_ulog(path)
