"""CRTP packets, tables and commands: what is packed is read back, and what is damaged is refused or counted."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import GoTo, Position, Rates, Stop, Vertical
from vehicle.crazyflie.crtp import MOST_DATA, Packet, pack, unpack
from vehicle.crazyflie.table import (
    LOG_KINDS,
    PARAMETER_KINDS,
    Contents,
    TableError,
    Variable,
    packed,
    read_info,
    read_item,
)

NUMBERS = st.floats(-1e4, 1e4, width=32)
NAMES = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=12)


@given(st.integers(0, 15), st.integers(0, 3), st.binary(max_size=MOST_DATA))
def test_packet_is_read_back_as_it_was_packed(port, channel, data):
    assert unpack(pack(Packet(port, channel, data))) == Packet(port, channel, data)


@given(st.binary(max_size=60))
def test_any_datagram_is_a_packet_or_none(datagram):
    packet = unpack(datagram)
    assert (packet is None) == (not 1 <= len(datagram) <= 1 + MOST_DATA)


@pytest.mark.parametrize("packet", [Packet(16, 0), Packet(0, 4), Packet(-1, 0), Packet(0, 0, bytes(31))])
def test_packet_that_the_protocol_does_not_have_is_not_packed(packet):
    with pytest.raises(ValueError, match="CRTP"):
        pack(packet)


def test_probe_of_a_client_that_looks_for_vehicles_is_a_null_packet():
    assert unpack(b"\xff").null


@given(st.lists(st.tuples(NAMES, NAMES, st.sampled_from(sorted(LOG_KINDS))), unique_by=lambda v: v[:2], max_size=20))
def test_table_is_read_back_item_by_item(entries):
    table = Contents([Variable(*entry) for entry in entries], LOG_KINDS)
    assert read_info(table.answer(b"\x03", (16, 128))) == (len(entries), table.crc)
    for number, entry in enumerate(entries):
        answer = table.answer(struct.pack("<BH", 2, number))
        assert read_item(answer, LOG_KINDS) == (number, Variable(*entry))
    assert table.answer(struct.pack("<BH", 2, len(entries))) == b"\x02"


def test_crc_of_a_table_changes_with_a_name_and_with_a_type():
    tables = [
        Contents([Variable(group, name, kind)], PARAMETER_KINDS)
        for group, name, kind in (("a", "b", "uint8"), ("a", "c", "uint8"), ("a", "b", "float"))
    ]
    assert len({table.crc for table in tables}) == 3


def test_table_with_a_name_twice_or_too_long_is_refused():
    with pytest.raises(TableError, match="twice"):
        Contents([Variable("a", "b", "uint8")] * 2, LOG_KINDS)
    with pytest.raises(TableError, match="too long"):
        Contents([Variable("a" * 20, "b" * 20, "uint8")], LOG_KINDS)


def test_item_of_an_unknown_type_is_refused():
    with pytest.raises(TableError, match=r"a\.b has type 0xc"):
        read_item(b"\x02\x00\x00\x0ca\x00b\x00", PARAMETER_KINDS)


@given(st.floats(allow_nan=True), st.sampled_from([form for _, form in LOG_KINDS.values()]))
def test_any_number_is_packed_in_any_kind(value, form):
    assert len(packed(value, form)) == struct.calcsize(form)


@given(st.tuples(*[st.floats(-20, 20)] * 3), st.integers(0, 65535))
def test_rate_set_point_is_read_back_with_its_signs(rate, word):
    found = commands.read_generic(commands.rates(Rates(rate, word)).data)
    assert found.word == word
    assert found.body_rate == pytest.approx(rate, abs=1e-5)


def test_pitch_rate_is_sent_with_the_firmware_s_sign():
    roll, pitch, yaw = struct.unpack_from("<fff", commands.rates(Rates((0.1, 0.2, 0.3), 1)).data, 1)
    assert (roll, pitch, yaw) == pytest.approx([math.degrees(v) for v in (0.1, -0.2, 0.3)])


@given(NUMBERS, st.one_of(st.none(), NUMBERS), st.floats(0, 60, width=32), st.booleans())
def test_take_off_and_landing_are_read_back(height, yaw, duration, landing):
    command = Vertical(landing, height, yaw, duration)
    assert commands.read_high_level(commands.vertical(command).data) == command


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), NUMBERS, st.floats(0, 60, width=32), st.booleans())
def test_flight_to_a_place_is_read_back(position, yaw, duration, relative):
    command = GoTo(relative, position, yaw, duration)
    assert commands.read_high_level(commands.go_to(command).data) == command


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.tuples(*[st.floats(-1, 1, width=32)] * 4))
def test_external_pose_is_read_back(position, orientation):
    assert commands.read_external(commands.external_pose(position, orientation)) == (position, orientation)


@given(st.binary(max_size=MOST_DATA))
def test_any_data_is_a_set_point_or_none(data):
    for found in (commands.read_generic(data), commands.read_legacy(data, (True, True, True))):
        assert found is None or isinstance(found, Rates | commands.Attitude | Position | Stop)
        if isinstance(found, Rates):
            assert all(map(math.isfinite, found.body_rate))
    commands.read_high_level(data)
    for channel in (0, 1):
        commands.read_external(Packet(6, channel, data))
