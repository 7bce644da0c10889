"""Rigs with real links: faults of the file are reported when it is read, missing devices by `reach`."""

import math
import socket
import sys
import threading

import pytest

from hil.assembly.builder import Assembly
from hil.assembly.node_table import NODES, service_nodes
from hil.assembly.rig import Calibration, CameraSlot, Rig, list_rigs, load_rig
from hil.assembly.sensing import mounted_cameras
from hil.assembly.simulation import build
from hil.assembly.twin import simulated_twin
from hil.contract.wire import CanFrame
from hil.live.reach import reach
from hil.viewer.view import free_port
from hil.wires import WireError
from hil.wires.can import open_can
from kernel.toml_errors import ConfigError
from scenarios.draw import draw
from scenarios.spec import load
from vehicle.px4.codec import Packer
from vehicle.quadrotor.airframe import load_airframe


@pytest.mark.parametrize("name", ["sim", "px4-sitl", "px4-firmware", "bench", "field"])
def test_shipped_rigs_can_be_read_and_warmed_up(name):
    rig = load_rig(name)
    assert rig.simulated == (name in ("sim", "px4-firmware"))
    assert simulated_twin(rig).simulated
    assert name in list_rigs()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[vehicle]\nkind = "mavlink"', "needs a url"),
        ('[vehicle]\nkind = "mavlink"\nurl = "14540"', "udp://:14540"),
        ('[vehicle]\nurl = "udp://:14540"', 'kind "sim" has none'),
        ('[vehicle]\nkind = "hitl"', "needs a simulator"),
        ('[vehicle]\nsimulator = "tcp://:4560"', "others have none"),
        ('[vehicle]\nkind = "hitl"\nsimulator = "udp://:4560"', "no address of a simulator link"),
        ('[vehicle]\nkind = "hitl"\nsimulator = "serial:///dev/ttyACM0"', "needs a url as well"),
        (
            '[vehicle]\nkind = "hitl"\nsimulator = "serial:///dev/ttyACM0"\nurl = "udp://:14540"\npx4 = "build"',
            "px4 is a build folder",
        ),
        ('[vehicle]\nkind = "sim"\ndeterministic = true', "deterministic is for kind"),
        (
            '[vehicle]\nkind = "hitl"\nsimulator = "serial:///dev/ttyACM0"\nurl = "udp://:14540"\ndeterministic = true',
            "deterministic is for kind",
        ),
        ('[vehicle]\nkind = "hitl"\nsimulator = "tcp://:4560"\npowered = true', "flight controller"),
        ('[camera]\nkind = "v4l2"', "needs a device"),
        ('[camera]\nkind = "v4l2"\ndevice = "/dev/video0"\nsource = "model"', "simulated"),
        ('[groundcar]\nkind = "can"\ninterface = "pcan"', "socketcan"),
        ('[mocap]\nkind = "vrpn"', "needs a server"),
        ('[mocap]\nserver = "10.0.0.1"', 'kind "sim" has none'),
        ('[camera]\nkind = "v4l2"\ndevice = "/dev/video0"\npixel_format = "JPEG2000"', "pixel_format"),
        ("[car_gate]\nspeed = 9.0", "speed"),
        ('[vehicle]\nairframe = "paper_qad"', "vehicle.airframe.*did you mean 'paper_quad'"),
        ('[vehicle]\nairframe = "none.toml"', "vehicle.airframe.*none.toml: cannot be read"),
        ('[vehicle]\nhover_speed = "0.1"', "vehicle.hover_speed.*valid number, but it is .0.1."),
        ('[gate]\nrate = "3.0"', "gate.rate.*valid number"),
        ("[gate]\nx = [-1.0, true]", "gate.x.1.*valid number"),
        ('[camera]\ntransport_ms = "15"', "camera.transport_ms.*valid number"),
        ("[camera.calibration]\ncx = nan", "calibration.cx.*finite"),
        ("[camera.calibration]\nfx = inf", "calibration.fx.*finite"),
        ('[camera.calibration]\nmodel = "wide"', "calibration.model"),
        ('[camera.calibration]\nmodel = "fisheye"\ndistortion = [0.1]', "4 coefficients, not 1"),
        ("[policy]\nguidance = 1", "policy.guidance.*boolean"),
        ('[vehicle]\nkind = "mavlink"\nurl = "udp://:14540"\nexternal_pose = true', "its own estimate"),
        (
            '[vehicle]\nkind = "mavlink"\nurl = "radio://0/80/2M/E7E7E7E7E7"',
            'radio:// is the address of kind "crazyflie"',
        ),
        ('[vehicle]\nkind = "crazyflie"\nurl = "radio://0/200/2M/E7"', "vehicle.url.*channels 0 to 125"),
        ('[vehicle]\nkind = "crazyflie"\nurl = "tcp://host:1"\nexternal_pose = true', "is the address of kind"),
        ('[vehicle]\nkind = "crazyflie"', "needs a url"),
        ('[vehicle]\nkind = "crazyflie-sim"', "set external_pose = true"),
        (
            '[vehicle]\nkind = "crazyflie"\nurl = "radio://0/80/2M/E7E7E7E7E7"\nexternal_pose = true',
            "its own estimate",
        ),
        ('[policy]\nknows = "lidar"', "policy.knows.*camera"),
    ],
)
def test_incomplete_rig_raises_when_read(tmp_path, text, expected):
    path = tmp_path / "mine.toml"
    path.write_text(f'title = "mine"\n{text}\n')
    with pytest.raises(ConfigError, match=expected):
        load_rig(str(path))


def test_a_real_device_has_no_simulated_process():
    assert "vehicle_device" in service_nodes(load_rig("sim"))
    assert "vehicle_device" not in service_nodes(load_rig("px4-sitl"))
    assert "vehicle_device" in service_nodes(load_rig("bench")), "its body is ours, its autopilot is not"
    assert "car_device" not in service_nodes(load_rig("field"))


def found(rig, listen_s=0.1):
    return {slot.slot: slot for slot in reach(rig, listen_s=listen_s)}


def test_missing_devices_are_named_for_each_slot(tmp_path):
    there = found(load_rig("bench"))
    assert "/dev/ttyACM0" in there["vehicle"].text
    there = found(rig(camera={"kind": "v4l2", "device": "/dev/video0"}))
    assert "/dev/video0" in there["camera"].text
    assert [slot.slot for slot in there.values() if slot.ok] == ["vehicle", "groundcar", "mocap"]
    assert all(slot.ok for slot in reach(load_rig("sim"), listen_s=0.1))


def rig(**slots):
    return Rig.model_validate({"title": "mine", **slots})


def test_recorded_camera_without_a_recording_is_refused(tmp_path):
    seen = found(rig(camera={"kind": "mcap", "device": str(tmp_path / "none")}))["camera"]
    assert (seen.ok, seen.kind) == (False, "mcap")
    assert "cannot be read" in seen.text


def test_silent_motion_capture_server_is_named():
    pytest.importorskip("motioncapture", reason="kind vrpn: the package motioncapture is not installed")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        server = f"127.0.0.1:{silent.getsockname()[1]}"
        seen = found(rig(mocap={"kind": "vrpn", "server": server}))["mocap"]
    assert not seen.ok
    assert f"motion capture at {server} sends nothing" in seen.text


def test_missing_motion_capture_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    seen = found(rig(mocap={"kind": "vrpn", "server": "127.0.0.1"}))["mocap"]
    assert not seen.ok
    assert "needs the Python package motioncapture" in seen.text


def autopilot(port, data, times=60):
    """A sender of `data` to a port for a while."""

    def talk():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for _ in range(times):
                out.sendto(data, ("127.0.0.1", port))
                ended.wait(0.01)

    ended = threading.Event()
    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    return thread


@pytest.mark.parametrize(
    ("data", "ok", "expected"),
    [
        (Packer(1, 1).send_name("HEARTBEAT", 2, 12, 29, 0, 3, 3), True, "MAVLink comes in"),
        (b"\x00garbage", False, "data that are no MAVLink came"),
    ],
)
def test_reach_listens_on_the_port_of_the_vehicle(data, ok, expected):
    port = free_port()
    thread = autopilot(port, data)
    seen = found(rig(vehicle={"kind": "mavlink", "url": f"udp://:{port}"}), listen_s=0.5)["vehicle"]
    thread.join()
    assert (seen.ok, expected in seen.text) == (ok, True), seen.text


def test_vehicle_port_in_use_is_named():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", 0))
        port = other.getsockname()[1]
        seen = found(rig(vehicle={"kind": "mavlink", "url": f"udp://:{port}"}))["vehicle"]
    assert not seen.ok
    assert f"UDP port {port} on 0.0.0.0 is in use" in seen.text


@pytest.mark.parametrize(
    ("can_id", "ok", "expected"),
    [(0x221, True, "protocol V2"), (0x151, False, "uses protocol V1"), (0x7AB, False, "1 other identifiers")],
)
def test_car_is_recognised_by_its_can_frames(can_id, ok, expected):
    channel = f"reach-{can_id:x}"
    slot = {"kind": "can", "interface": "virtual", "channel": channel}
    car = open_can("virtual", channel)
    ended = threading.Event()

    def talk():
        while not ended.wait(0.01):
            car.send(CanFrame(can_id, bytes(8)))

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    seen = found(rig(groundcar=slot), listen_s=0.5)["groundcar"]
    ended.set()
    thread.join()
    car.close()
    assert (seen.ok, expected in seen.text) == (ok, True), seen.text


def test_recorded_camera_is_not_a_real_device():
    assert rig(camera={"kind": "mcap", "device": "runs/x"}).simulated
    assert not rig(camera={"kind": "v4l2", "device": "/dev/video0"}).simulated


def test_a_device_is_not_opened_by_a_host_that_does_not_keep_real_time():
    scenario = load("simple-i")
    real = rig(camera={"kind": "v4l2", "device": "/dev/video77"})
    drawn = draw(scenario, 0)
    with pytest.raises(ValueError, match="only the live host does"):
        Assembly(scenario, real, drawn, lambda: None, None).node("camera")  # type: ignore[arg-type]
    with pytest.raises(WireError, match="there is no camera /dev/video77"):
        Assembly(scenario, real, drawn, lambda: None, None, lambda: 0).node("camera")  # type: ignore[arg-type]
    assert [name for name, row in NODES.items() if row.measures(real)] == ["camera"]


def test_the_camera_of_a_device_is_the_airframe_s_without_drawn_errors():
    scenario, frame = load("simple-i"), load_airframe("paper_quad")
    drawn = draw(scenario, 3)
    true, calibrated = mounted_cameras(CameraSlot(kind="v4l2", device="/dev/video0"), frame, drawn)
    assert true == calibrated
    assert math.degrees(true.tilt) == pytest.approx(frame.camera.tilt_deg)
    own = Calibration(width=640, height=480, fx=500.0, fy=501.0, cx=320.0, cy=240.0)
    _, calibrated = mounted_cameras(CameraSlot(kind="gstreamer", device="x", calibration=own), frame, drawn)
    assert (calibrated.width, calibrated.fx, calibrated.cy) == (640, 500.0, 240.0)
    true, calibrated = mounted_cameras(CameraSlot(), frame, drawn)
    assert calibrated.tilt - true.tilt == pytest.approx(drawn.camera_tilt_error)


def test_lockstep_refuses_real_devices():
    with pytest.raises(ValueError, match="--live"):
        build(None, load_rig("px4-sitl"), None, None, lambda: 0)  # type: ignore[arg-type]
