"""Items of the camera and the board: each fault is seen by the item meant for it."""

import math
from dataclasses import replace

import pytest

from hil.bench import camera as bench_camera
from hil.bench.reading import NotApplicable, Unavailable
from hil.check.judge import Outcome
from scenarios.spec import load
from tests.unit.hil.check.made_up import context as make_context
from tests.unit.hil.check.preflight import result, with_slot
from vehicle.render.renderer import Renderer


@pytest.mark.parametrize("scenario", ["simple-ii", "normal-i", "hard-ii"])
def test_camera_item_measures_the_inclination_of_the_board(tmp_path, scenario):
    context = replace(make_context(tmp_path), scenario=load(scenario))
    seen = context.camera().measure_board(2.0)
    error = math.degrees(context.drawn.camera_tilt_error)
    for picture in seen:
        assert picture.pose.found
        assert picture.distance == pytest.approx(2.0, abs=0.01)
        # what is left is the calibration's own error, and motion capture's noise
        assert abs(picture.inclination - context.scenario.board.inclination_deg) == pytest.approx(abs(error), abs=0.3)


def test_inclination_item_fails_on_a_board_at_another_angle(context):
    bench = context.camera()
    bench.measure_board(2.0)
    bench.set_deg -= 10.0  # the scenario's angle differs from the board's
    judged = result(context, "board.inclination")
    assert judged.outcome is Outcome.FAIL


def test_camera_decode_fails_with_a_covered_lens(context, monkeypatch):
    class Covered(Renderer):
        def render(self, vehicle, board, exposure_ns, frame_index):
            picture = super().render(vehicle, board, exposure_ns, frame_index)
            picture[:] = 3
            return picture

    monkeypatch.setattr(bench_camera, "Renderer", Covered)
    assert result(context, "camera.decode").outcome is Outcome.FAIL
    with pytest.raises(Unavailable, match="in none of 10 pictures"):
        result(context, "board.inclination")


def test_camera_item_fails_when_the_exposure_exceeds_the_picture_period(context):
    fast = replace(context, scenario=load("hard-i"))
    assert result(with_slot(fast, "camera", exposure_ms=25.0), "camera.mode").outcome is Outcome.FAIL


def test_a_camera_model_has_no_pictures_to_decode(context):
    with pytest.raises(NotApplicable, match="model"):
        result(with_slot(context, "camera", source="model"), "camera.decode")
