import math

import pytest

from scenarios.paper import RealRow, SimulatedRow, paper, published, row_keys


def test_rows_are_typed_and_complete():
    assert len(row_keys()) == 12
    assert all(isinstance(published(k), RealRow) for k in row_keys() if k.startswith("real."))
    assert isinstance(published("vision.t3"), SimulatedRow)


def test_planar_error_is_the_length_of_x_and_y_as_printed():
    for row in paper().real.values():
        assert row.planar == pytest.approx(math.hypot(row.x, row.y), abs=0.011)  # printed to two decimals


def test_three_published_flights_lie_outside_the_papers_tolerances():
    outside = [name for name, row in paper().real.items() if not row.within(paper().tolerance)]
    assert outside == ["simple-ii", "normal-i", "normal-ii"]


def test_average_loss_of_the_vision_stage_is_the_printed_one():
    loss = [paper().state[t].success_percent - paper().vision[t].success_percent for t in ("t1", "t2", "t3")]
    assert sum(loss) / 3 == pytest.approx(8.29, abs=0.005)


def test_field_of_view_gives_square_pixels():
    setup = paper().setup
    width, height = setup.camera_width, setup.camera_height
    fx = width / 2 / math.tan(math.radians(setup.field_of_view_deg[0]) / 2)
    fy = height / 2 / math.tan(math.radians(setup.field_of_view_deg[1]) / 2)
    assert (fx, fy) == (pytest.approx(723.9, abs=0.1), pytest.approx(723.6, abs=0.1))


def test_unknown_row_names_the_nearest():
    with pytest.raises(ValueError, match=r'did you mean "real\.hard-i"'):
        published("real.hard1")
