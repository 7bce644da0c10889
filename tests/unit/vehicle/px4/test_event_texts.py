"""PX4's events in words: fields, units and enumerations of a description; what is not described says nothing."""

import json
import lzma
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.px4.event_texts import EventTexts, load_events

REASON = {"type": "uint8_t", "entries": {"4": {"name": "command", "description": "external command"}}}
DESCRIPTION = {
    "version": 2,
    "components": {
        "1": {
            "namespace": "px4",
            "enums": {"reason_t": REASON},
            "event_groups": {
                "default": {
                    "events": {
                        "5": {"name": "takeoff", "message": "Takeoff detected"},
                        "6": {
                            "name": "armed",
                            "message": "Armed by {1}",
                            "arguments": [{"name": "a", "type": "px4::reason_t"}],
                        },
                        "7": {
                            "name": "climb",
                            "message": "Climb {2:.1m_v} at {3:.0m/s}, see <param>X_{1}</param>",
                            "arguments": [
                                {"name": "a", "type": "uint8_t"},
                                {"name": "b", "type": "float"},
                                {"name": "c", "type": "float"},
                            ],
                        },
                        "8": {"name": "broken", "message": "{2}", "arguments": [{"name": "a", "type": "uint8_t"}]},
                    }
                },
                "health": {"events": {"9": {"name": "x", "message": "Gyro {1}", "arguments": [{"type": "reason_t"}]}}},
            },
        }
    },
}
PX4 = 1 << 24


@pytest.fixture
def events():
    return EventTexts(DESCRIPTION)


def test_events_are_put_into_words(events):
    said = events.read(PX4 | 5, bytes(40))
    assert (said.group, said.name, said.text) == ("default", "takeoff", "Takeoff detected")
    assert events.read(PX4 | 6, b"\x04" + bytes(39)).text == "Armed by external command"
    assert events.read(PX4 | 6, b"\x05" + bytes(39)).text == "Armed by 5"
    assert events.read(PX4 | 7, struct.pack("<Bff", 3, 2.04, 1.6)).text == "Climb 2.0 m at 2 m/s, see X_3"
    said = events.read(PX4 | 9, b"\x04")
    assert (said.group, said.text) == ("health", "Gyro external command")


@given(st.integers(0, 2**32 - 1), st.binary(max_size=40))
def test_events_that_are_not_described_say_nothing_and_none_raises(id, arguments):
    events = EventTexts(DESCRIPTION)
    if not PX4 | 5 <= id <= PX4 | 9:
        assert events.read(id, arguments) is None
    for known in range(5, 10):
        events.read(PX4 | known, arguments)
    assert events.read(PX4 | 8, bytes(40)) is None


@pytest.mark.parametrize("content", [{}, [], {"components": {"1": {}}}, {"components": {"x": None}}])
def test_what_describes_no_events_is_refused(content, tmp_path):
    with pytest.raises(ValueError, match="does not describe events"):
        EventTexts(content)


@pytest.mark.parametrize("data", [b"", b"no archive", lzma.compress(b"{"), lzma.compress(b"\xff\xfe{")])
def test_file_that_cannot_be_read_is_refused(data, tmp_path):
    file = tmp_path / "all_events.json.xz"
    file.write_bytes(data)
    with pytest.raises(ValueError, match="cannot be read"):
        load_events(file)


def test_file_of_a_build_is_read(tmp_path):
    file = tmp_path / "all_events.json.xz"
    file.write_bytes(lzma.compress(json.dumps(DESCRIPTION).encode()))
    assert load_events(file).read(PX4 | 5, b"").text == "Takeoff detected"
