"""The views: no frame is named before its first transform, and corners lie in the pixels of the sent picture."""

import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from hil.contract import messages as m
from hil.recording.foxglove import FoxgloveView
from tests.unit.hil.recording.recorded_flight import LEVEL, PICTURE, flight
from vehicle.camera.lens import Lens
from vehicle.camera.pinhole import Camera

CORNERS = (99.5, 199.5, 299.5, 199.5, 299.5, 399.5, 99.5, 399.5)


def detection(stamp_ns, corners=CORNERS):
    return m.Detection(stamp_ns, True, (0.0,) * 3, LEVEL, 0.01, 0.01, (0,) * (len(corners) // 8), corners, "", 0, 1)


def outlines(view, picture_ns, detection_ns, corners=CORNERS):
    view("camera/image", m.Image(picture_ns, 1280, 720, 1, PICTURE, 0))
    views = dict(view("board/detection", detection(detection_ns, corners)))
    return ImageAnnotations.FromString(views["/camera/annotations"]) if "/camera/annotations" in views else None


def test_box_is_not_drawn_before_the_first_transform_of_its_frame():
    view, known, drawn = FoxgloveView(pictures="none"), set(), []
    for _, topic, message in flight(2.0):
        for name, data in view(topic, message):
            if name == "/tf":
                known |= {t.child_frame_id for t in FrameTransforms.FromString(data).transforms}
            if name == "/scene":
                frames = [entity.frame_id for entity in SceneUpdate.FromString(data).entities]
                assert set(frames) <= known
                drawn += frames
    assert sorted(drawn) == ["board", "board_belief", "vehicle"]


@pytest.mark.parametrize(("pictures", "scale"), [("preview", 2), ("all", 1)])
def test_corners_are_in_the_pixels_of_the_sent_picture(pictures, scale):
    found = outlines(FoxgloveView(pictures=pictures), 5, 5)
    assert found is not None
    assert [(p.x * scale, p.y * scale) for p in found.points[0].points] == [
        (100, 200),
        (300, 200),
        (300, 400),
        (100, 400),
    ]


def test_corners_are_drawn_on_their_own_picture_only():
    view = FoxgloveView(pictures="preview")
    assert outlines(view, 5, 6) is None
    assert outlines(FoxgloveView(pictures="none"), 5, 5) is None
    empty = outlines(FoxgloveView(pictures="preview"), 5, 5, ())
    assert empty is not None and not empty.points  # wipes the outlines of an earlier picture


@pytest.mark.parametrize(
    ("lens", "model", "coefficients"),
    [
        (Lens(), "plumb_bob", [0.0] * 5),
        (Lens("pinhole", (0.1, 0.2, 0.0, 0.0, 0.3)), "plumb_bob", [0.1, 0.2, 0.0, 0.0, 0.3]),
        (Lens("rational", (0.1,) * 8), "rational_polynomial", [0.1] * 8),
        (Lens("fisheye", (0.1,) * 4), "kannala_brandt", [0.1] * 4),
    ],
)
def test_calibration_has_the_lens_of_the_camera(lens, model, coefficients):
    views = dict(FoxgloveView(Camera(lens=lens))("camera/image", m.Image(5, 1280, 720, 1, PICTURE, 0)))
    found = CameraCalibration.FromString(views["/camera/calibration"])
    assert found.distortion_model == model and list(found.D) == coefficients
