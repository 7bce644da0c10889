"""Checks that read a device on a real wire: software devices in real time stand behind UDP and a CAN bus."""

import socket
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import pytest

from groundcar.scout.sim import ScoutSim
from hil.assembly.rig import Rig
from hil.bench.reading import Unavailable
from hil.check.catalogue import checks
from hil.wires.can import open_can
from hil.wires.udp import UdpWire
from tests.contract.signed_wire import SignedWire
from tests.unit.hil.check.made_up import context as make_context
from vehicle.px4.codec import Packer
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe


@contextmanager
def real_time(device, wire):
    """Steps `device` every two milliseconds by the wall clock."""
    stop = threading.Event()
    start = time.monotonic_ns()

    def live():
        while not stop.wait(0.002):
            device.step(time.monotonic_ns() - start)

    thread = threading.Thread(target=live)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        wire.close()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def with_rig(tmp_path, **slots):
    rig = Rig.model_validate({"title": "bench", **slots})
    assert not rig.simulated
    return replace(make_context(tmp_path), rig=rig, rig_name="bench")


def read(context, check, **args):
    return checks()[check].function(context, **args)


def number(context, check, **args) -> float:
    value = read(context, check, **args).value
    assert isinstance(value, int | float)
    return float(value)


def test_an_autopilot_on_udp_is_read_without_arming_it(tmp_path):
    port = free_port()
    wire = UdpWire(("127.0.0.1", 0), ("127.0.0.1", port), partner="fixed")
    sim = Px4Sim({"api": wire}, load_airframe("paper_quad"))
    context = with_rig(tmp_path, vehicle={"kind": "mavlink", "url": f"udp://:{port}", "clock_drift": 0.03})
    with real_time(sim, wire):
        try:
            assert read(context, "vehicle.prearm").ok
            assert read(context, "vehicle.disarmed").ok
            assert number(context, "vehicle.heartbeat") < 1.5
            assert number(context, "vehicle.odometry") > 50.0  # of 100: this test shares its processor
            assert read(context, "vehicle.parameter", name="COM_OF_LOSS_T").value == pytest.approx(0.3)
            assert read(context, "vehicle.battery").source == f"autopilot at udp://:{port}"
            with pytest.raises(Unavailable, match="simulated vehicles only"):
                read(context, "vehicle.kill")
            assert not sim.truth().armed
            context.forget()  # the port is free again: a second look opens it anew
            assert read(context, "vehicle.disarmed").ok
        finally:
            context.forget()


def test_bench_measures_the_stop_of_a_car_on_a_can_bus(tmp_path):
    wire = open_can("virtual", "check")
    sim = ScoutSim(wire)
    context = with_rig(tmp_path, groundcar={"kind": "can", "interface": "virtual", "channel": "check"})
    with real_time(sim, wire):
        try:
            assert read(context, "car.mode").value == "can"
            stop = read(context, "car.stop", speed=0.3)
            assert isinstance(stop.value, float)
            assert 0.45 < stop.value < 0.9
            assert stop.source == "car on virtual check"
            time.sleep(0.5)
            assert abs(sim.speed) < 0.02
        finally:
            context.forget()


def test_device_without_an_answer_is_unknown_and_its_address_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("hil.bench.vehicle._ANSWER_LIMIT_NS", 300_000_000)
    port = free_port()
    context = with_rig(tmp_path, vehicle={"kind": "mavlink", "url": f"udp://:{port}"})
    with pytest.raises(Unavailable, match=f"no working link to autopilot at udp://:{port}"):
        read(context, "vehicle.heartbeat")
    context.forget()
    context = with_rig(tmp_path, groundcar={"kind": "can", "interface": "socketcan", "channel": "nocan9"})
    with pytest.raises(Unavailable, match="nocan9"):
        read(context, "car.mode")


def test_absent_camera_or_motion_capture_is_unknown_with_the_reason(tmp_path):
    context = with_rig(tmp_path, camera={"kind": "v4l2", "device": "/dev/video77"})
    with pytest.raises(Unavailable, match="there is no camera /dev/video77"):
        read(context, "camera.mode")


def test_signed_autopilot_is_read_with_the_rigs_key_and_forged_frames_are_not(tmp_path):
    port, key = free_port(), tmp_path / "vehicle.key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    wire = UdpWire(("127.0.0.1", 0), ("127.0.0.1", port), partner="fixed")
    judge = SignedWire(wire, key.read_bytes(), (time.time_ns() - 1_420_070_400_000_000_000) // 10_000)
    sim = Px4Sim({"api": judge}, load_airframe("paper_quad"))
    slot = {"kind": "mavlink", "url": f"udp://:{port}", "clock_drift": 0.03, "signing_key": str(key)}
    context = with_rig(tmp_path, vehicle=slot)
    forged = Packer(1, 1).send_name("HEARTBEAT", 2, 3, 0x80, 0, 4, 3)  # another autopilot, armed
    with real_time(Forger(sim, wire, forged), judge):
        try:
            assert read(context, "vehicle.prearm").ok
            assert read(context, "vehicle.disarmed").ok
            assert read(context, "vehicle.heartbeat").ok is None
            assert read(context, "vehicle.parameter", name="COM_OF_LOSS_T").value == pytest.approx(0.3)
            assert context.autopilot()["uid"] == read(context, "vehicle.identity").value
            assert judge.accepted and not judge.refused
            key.write_bytes(bytes(range(1, 33)))
            context.forget()
            with pytest.raises(Unavailable, match="no working link"):
                read(context, "vehicle.heartbeat")
        finally:
            context.forget()


class Forger:
    """Steps a device, and sends an unsigned frame beside what it sends."""

    def __init__(self, device, wire, frame):
        self._device, self._wire, self._frame = device, wire, frame

    def step(self, now_ns):
        self._device.step(now_ns)
        self._wire.send(self._frame)


@pytest.mark.parametrize(("content", "mode", "told"), [(b"short", 0o600, "32 bytes"), (b"k" * 32, 0o644, "chmod 600")])
def test_unusable_signing_key_is_unknown_with_the_reason(tmp_path, content, mode, told):
    key = tmp_path / "vehicle.key"
    key.write_bytes(content)
    key.chmod(mode)
    slot = {"kind": "mavlink", "url": f"udp://:{free_port()}", "signing_key": str(key)}
    with pytest.raises(Unavailable, match=told):
        read(with_rig(tmp_path, vehicle=slot), "vehicle.heartbeat")
