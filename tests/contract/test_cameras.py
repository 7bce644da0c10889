"""What every kind of camera must do, whatever gives the pictures. Kinds whose hardware is missing skip by name."""

import time

import numpy as np
import pytest

from tests.contract.camera_makers import (
    MS,
    install_fake_gst,
    mcap_jpeg,
    mcap_raw,
    number,
    pipe,
    real_gstreamer,
    take,
    v4l2,
    video_file,
)


@pytest.fixture
def fake_gst(tmp_path, monkeypatch):
    install_fake_gst(tmp_path, monkeypatch)


KINDS = [video_file, mcap_raw, mcap_jpeg, pipe, real_gstreamer, v4l2]
KNOWN_PICTURES = [video_file, mcap_raw, mcap_jpeg, pipe]


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__)
def camera(request, tmp_path):
    if request.param is pipe:
        request.getfixturevalue("fake_gst")
    camera = request.param(tmp_path)
    yield camera
    camera.close()
    camera.close()  # twice does no harm


def test_pictures_arrive_in_the_requested_mode_in_order_and_with_their_age(camera):
    one, two = take(camera), take(camera)
    for each in (one, two):
        assert each.pixels.dtype == np.uint8
        assert each.pixels.shape == (camera.mode.height, camera.mode.width)
        assert 0 <= each.age_ns < 2_000 * MS
    assert two.sequence > one.sequence
    assert camera.lost == ""


def test_camera_delivers_each_picture_once(camera):
    first = take(camera)
    again = camera.take(time.monotonic_ns())
    assert again is None or again.sequence > first.sequence


@pytest.mark.parametrize("kind", KNOWN_PICTURES, ids=lambda kind: kind.__name__)
def test_camera_delivers_the_newest_picture_and_counts_the_others(kind, tmp_path, fake_gst):
    camera = kind(tmp_path)
    take(camera)
    until = time.monotonic() + 5.0
    seen = []
    while not camera.lost and time.monotonic() < until:  # a slow reader
        time.sleep(0.07)
        found = camera.take(time.monotonic_ns())
        if found is not None:
            seen.append(found)
            assert number(found.pixels) == pytest.approx(found.sequence, abs=1), "what it shows is what it says it is"
    assert [s.sequence for s in seen] == sorted({s.sequence for s in seen})
    assert camera.dropped >= 1
    camera.close()


@pytest.mark.parametrize("kind", KNOWN_PICTURES, ids=lambda kind: kind.__name__)
def test_lost_camera_is_reported_and_delivers_no_pictures(kind, tmp_path, fake_gst):
    camera = kind(tmp_path)
    until = time.monotonic() + 10.0
    while not camera.lost and time.monotonic() < until:
        camera.take(time.monotonic_ns())
        time.sleep(0.005)
    assert camera.source in camera.lost
    assert ("is gone" in camera.lost) or ("no more pictures" in camera.lost)
    assert camera.take(time.monotonic_ns()) is None
    camera.close()
