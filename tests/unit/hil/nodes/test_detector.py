import math

import pytest

from hil.contract.messages import Belief, Image, VehicleState
from hil.nodes.detector import Detector
from tests.unit.hil.contract.node_fakes import filled
from tests.unit.vehicle.apriltag.test_boards import scene
from tests.unit.vehicle.apriltag.test_detector import RENDERER, detector
from tests.unit.vehicle.render.camera_scene import CAMERA, ROW, view

MS = 1_000_000
VEHICLE, BOARD = view(1.5)


def odometry(stamp_ms, **changes):
    position, orientation = tuple(VEHICLE[:3].tolist()), tuple(VEHICLE[6:10].tolist())
    given = {"position": position, "orientation": orientation, **changes}
    return VehicleState(stamp_ms * MS, given["position"], (0.0,) * 3, given["orientation"], (0.0,) * 3)


def image(stamp_ms, pixels):
    return Image(stamp_ms * MS, CAMERA.width, CAMERA.height, 2 * MS, pixels.tobytes(), 0)


def step(node, now_ms, *messages):
    outs = node.step(now_ms * MS, filled(node, *messages))
    return [[out.message for out in outs if out.topic == topic] for topic in ("board/detection", "event")]


@pytest.fixture
def node():
    return Detector(detector(), ROW)


@pytest.fixture(scope="module")
def picture():
    return RENDERER.render(VEHICLE, BOARD, 0, 0)


def test_two_boards_in_view_are_reported_once_and_one_is_found(node):
    pixels, _, _ = scene(1.0, 2.5)
    found, events = step(node, 100, ("vehicle/odometry", odometry(90)), ("camera/image", image(90, pixels)))
    assert [one.found for one in found] == [True]
    assert [(one.severity, one.text.startswith("two boards in one picture")) for one in events] == [("warning", True)]
    _, again = step(node, 200, ("vehicle/odometry", odometry(190)), ("camera/image", image(190, pixels)))
    assert again == []
    assert node.counters["pictures with more than one board"] == 2


def test_odometry_stamped_later_than_now_is_reported_once_and_later_ones_are_used(node, picture):
    _, events = step(node, 10, ("vehicle/odometry", odometry(3_600_000)))
    assert [(one.severity, "later than now" in one.text) for one in events] == [("warning", True)]
    assert step(node, 20, ("vehicle/odometry", odometry(3_700_000)))[1] == []
    (found,), _ = step(node, 100, ("vehicle/odometry", odometry(90)), ("camera/image", image(90, picture)))
    assert found.found
    assert math.dist(found.position, BOARD[:3]) < 0.05


def test_picture_stamped_later_than_now_is_not_searched(node, picture):
    found, events = step(node, 100, ("vehicle/odometry", odometry(90)), ("camera/image", image(120, picture)))
    assert found == []
    assert ["later than now" in one.text for one in events] == [True]
    assert node.counters["pictures refused by the detector, stamped later than now"] == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"stamp_ns": -(2**62)}, {"stamp_ns": 2**62}, {"position": (math.nan, 0.0, 0.0)}, {"speed": math.inf},
        {"position": (1e300, 0.0, 0.0)}, {"turn_rate": 1e300}, {"heading": -math.inf},
    ],
)  # fmt: skip
def test_belief_that_cannot_be_used_is_no_prior(node, picture, changes):
    given = {
        "stamp_ns": 90 * MS, "valid": True, "position": (0.0, 0.0, 0.0), "heading": 0.0, "speed": 0.0, "turn_rate": 0.0,
        "inclination": 0.5, **changes,
    }  # fmt: skip
    belief = Belief(**given, rho=1.0, last_exposure_ns=0, accepted=9, rejected=0, variance=(0.0,) * 9,
                    acceleration=0.0, streak=9, surface_sigma=0.0)  # fmt: skip
    messages = ("belief", belief), ("vehicle/odometry", odometry(90)), ("camera/image", image(90, picture))
    (found,), _ = step(node, 100, *messages)
    assert found.found
