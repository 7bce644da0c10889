"""What the build folder of a firmware tells the driver."""

import json
import lzma

import pytest

from hil.assembly.hitl import BUILD, firmware_events
from hil.assembly.rig import load_rig

DESCRIPTION = {
    "components": {
        "1": {"namespace": "px4", "event_groups": {"default": {"events": {"5": {"name": "x", "message": "Takeoff"}}}}}
    }
}


@pytest.fixture
def description(tmp_path, monkeypatch):
    monkeypatch.setenv(BUILD, str(tmp_path))
    (tmp_path / "etc/extras").mkdir(parents=True)
    return tmp_path / "etc/extras/all_events.json.xz"


def test_events_of_a_build_are_read(description):
    description.write_bytes(lzma.compress(json.dumps(DESCRIPTION).encode()))
    found = firmware_events(load_rig("px4-firmware").vehicle)
    assert found and found.read(1 << 24 | 5, b"").text == "Takeoff"


def test_build_without_a_description_flies_without_it(description):
    assert firmware_events(load_rig("px4-firmware").vehicle) is None
    description.write_bytes(b"no archive")
    assert firmware_events(load_rig("px4-firmware").vehicle) is None


def test_other_rigs_have_none(description):
    description.write_bytes(lzma.compress(json.dumps(DESCRIPTION).encode()))
    assert firmware_events(load_rig("sim").vehicle) is None
