import numpy as np
import pytest

from hil.contract.messages import Stage
from hil.nodes.camera_device import CameraDevice
from hil.wires import WireError
from hil.wires.camera import Picture
from tests.unit.hil.contract.node_fakes import filled

MS = 1_000_000
NOW = 1_000 * MS


class FakeCamera:
    """Returns the scripted pictures."""

    def __init__(self):
        self.pictures, self.lost, self.dropped, self.damaged, self.closed = [], "", 3, 1, False

    def take(self, now_ns):
        return self.pictures.pop(0) if self.pictures else None

    def close(self):
        self.closed = True


def step(node, stage, now_ns=NOW):
    return node.step(now_ns, filled(node, ("run/stage", Stage(now_ns, stage, 1, 1))))


def picture(age_ms=20, sequence=7):
    return Picture(age_ms * MS, np.arange(12, dtype=np.uint8).reshape(3, 4), sequence)


def test_a_picture_is_stamped_with_the_middle_of_its_exposure():
    camera = FakeCamera()
    node = CameraDevice(camera, 2 * MS)
    camera.pictures = [picture()]
    (out,) = step(node, "attempt")
    image = out.message
    assert (out.topic, image.stamp_ns, image.width, image.height) == ("camera/image", NOW - 20 * MS, 4, 3)
    assert (image.exposure_ns, image.sequence, image.data) == (2 * MS, 7, bytes(range(12)))
    assert step(node, "attempt") == []
    assert node.counters["pictures replaced before they were read"] == 3
    assert node.counters["damaged pictures"] == 1


@pytest.mark.parametrize("stage", ["prepare", "ended"])
def test_no_picture_is_published_before_the_lead_or_after_the_end(stage):
    camera = FakeCamera()
    camera.pictures = [picture()]
    assert step(CameraDevice(camera, MS), stage) == []
    assert CameraDevice(camera, MS).step(NOW, filled(CameraDevice(camera, MS))) == []


@pytest.mark.parametrize("stage", ["prepare", "lead", "attempt"])
def test_a_lost_camera_is_reported_and_counted_and_then_ends_the_service(stage):
    camera = FakeCamera()
    node = CameraDevice(camera, MS)
    camera.lost = "camera /dev/video0 is gone"
    (out,) = step(node, stage)
    assert (out.topic, out.message.severity, out.message.text) == ("event", "error", camera.lost)
    assert node.counters["cameras lost"] == 1
    with pytest.raises(WireError, match="/dev/video0 is gone"):
        step(node, stage)
    node.close()
    assert camera.closed


def test_end_of_a_recording_is_reported_once_and_the_run_continues():
    camera = FakeCamera()
    node = CameraDevice(camera, MS, real=False)
    camera.lost = "no more pictures"
    (out,) = step(node, "attempt")
    assert (out.topic, out.message.severity) == ("event", "warning")
    assert step(node, "attempt") == []
