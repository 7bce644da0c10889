"""Rigs with real links: what is missing in the file is told when it is read, what is missing outside by `reach`."""

import pytest

from hil.host.live_reach import reach
from hil.host.live_spec import services, simulated_twin
from hil.rig import list_rigs, load_rig
from hil.simulation import build
from scenarios.toml_errors import ConfigError


@pytest.mark.parametrize("name", ["sim", "px4-sitl", "bench", "field"])
def test_the_rigs_that_come_with_it_can_be_read_and_warmed_up(name):
    rig = load_rig(name)
    assert rig.simulated == (name == "sim")
    assert simulated_twin(rig).simulated
    assert name in list_rigs()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[vehicle]\nkind = "mavlink"', "needs a url"),
        ('[vehicle]\nkind = "mavlink"\nurl = "14540"', "udp://:14540"),
        ('[vehicle]\nurl = "udp://:14540"', 'kind "sim" has none'),
        ('[camera]\nkind = "v4l2"', "needs a device"),
        ('[camera]\nkind = "v4l2"\ndevice = "/dev/video0"\nsource = "model"', "simulated"),
        ('[groundcar]\nkind = "can"\ninterface = "pcan"', "socketcan"),
    ],
)
def test_an_incomplete_rig_is_an_error_when_it_is_read(tmp_path, text, told):
    path = tmp_path / "mine.toml"
    path.write_text(f'title = "mine"\n{text}\n')
    with pytest.raises(ConfigError, match=told):
        load_rig(str(path))


def test_a_real_device_has_no_simulated_process():
    assert "vehicle_device" in services(load_rig("sim"))
    assert "vehicle_device" not in services(load_rig("px4-sitl"))
    assert "car_device" not in services(load_rig("field"))


def test_what_is_not_there_is_named_slot_by_slot():
    found = {slot.slot: slot for slot in reach(load_rig("field"), listen_s=0.1)}
    assert not found["mocap"].ok
    assert "vrpn" in found["mocap"].text
    assert all(slot.ok for slot in reach(load_rig("sim"), listen_s=0.1))


def test_lockstep_refuses_real_devices():
    with pytest.raises(ValueError, match="--live"):
        build(None, load_rig("px4-sitl"), None, None, lambda: 0)  # type: ignore[arg-type]
