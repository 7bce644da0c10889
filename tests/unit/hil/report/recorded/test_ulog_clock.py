"""PX4's log on the run's clock: by synchronisation, by body rates, and a log of another flight."""

from dataclasses import replace

import numpy as np
import pytest

from hil.report.recorded.flight import load
from hil.report.recorded.ulog import LogTopic
from hil.report.recorded.ulog_clock import align, log_rates
from tests.paths import FIRMWARE_RUN


@pytest.fixture(scope="module")
def flown():
    return load(FIRMWARE_RUN)


def parts(flown):
    return flown.topics["vehicle/status"], flown.topics["vehicle/odometry"]


def shifted(log, by_s):
    """The log of an autopilot whose clock is `by_s` ahead."""
    topics = {}
    for name, topic in log.topics.items():
        fields = dict(topic.fields)
        if "timestamp_sample" in fields:
            fields["timestamp_sample"] = fields["timestamp_sample"].astype(np.int64) + round(by_s * 1e6)
        topics[name] = LogTopic(topic.us + round(by_s * 1e6), fields)
    return replace(log, topics=topics)


def test_synchronised_log_agrees_with_the_body_rates(flown):
    clock = flown.log_clock
    assert clock.source == "time synchronisation" and not clock.trouble
    assert clock.check.correlation > 0.95
    assert abs(clock.check.offset) < 0.02 and 0.0 < clock.check.sigma < 0.01


def test_rates_of_the_log_lie_on_those_of_the_run(flown):
    us, rates = log_rates(flown.log)
    odometry = flown.topics["vehicle/odometry"]
    t = flown.log_clock.run_ns(us)
    inside = (t > odometry.nanoseconds()[0]) & (t < odometry.nanoseconds()[-1])
    for axis in range(3):
        run = np.interp(t[inside], odometry.nanoseconds(), odometry["body_rate"][:, axis])
        assert np.std(run - rates[inside, axis]) < 0.3


@pytest.mark.parametrize("by_s", [0.03, -0.05, 0.2])
def test_clock_error_is_found_within_its_uncertainty(flown, by_s):
    true = flown.log_clock.check
    check = align(shifted(flown.log, by_s), *parts(flown)).check
    assert check.offset - true.offset == pytest.approx(-by_s, abs=max(3 * true.sigma, 0.004))


@pytest.mark.parametrize("by_s", [0.0, 1234.5])
def test_log_without_synchronisation_is_placed_by_its_rates(flown, by_s):
    clock = align(shifted(flown.log, by_s), None, flown.topics["vehicle/odometry"])
    assert clock.source == "body rates" and not clock.trouble
    us = flown.log.topics["vehicle_angular_velocity"].us
    apart = clock.run_ns(us + round(by_s * 1e6)) - flown.log_clock.run_ns(us)
    assert np.abs(apart / 1e9 - flown.log_clock.check.offset).max() < 0.02


def test_log_of_another_flight_is_told(flown):
    gyro = flown.log.topics["vehicle_angular_velocity"]
    backwards = {n: v if n.startswith("timestamp") else v[::-1] for n, v in gyro.fields.items()}
    other = replace(flown.log, topics={**flown.log.topics, "vehicle_angular_velocity": LogTopic(gyro.us, backwards)})
    assert "hardly the log of this flight" in align(other, *parts(flown)).trouble
    late = align(shifted(flown.log, 5000.0), *parts(flown))
    assert "do not overlap" in late.trouble


def test_log_without_rates_and_run_without_synchronisation_cannot_be_placed(flown):
    topics = {n: t for n, t in flown.log.topics.items() if n != "vehicle_angular_velocity"}
    bare = replace(flown.log, topics=topics)
    assert align(bare, *parts(flown)).source == "time synchronisation"
    assert "does not tell PX4's time" in align(bare, None, None).trouble


def test_offset_that_drifts_is_followed(flown):
    clock = replace(flown.log_clock, px4_ns=np.array([0, 10_000_000_000]), ours_ns=np.array([0, 10_100_000_000]))
    np.testing.assert_allclose(clock.run_ns(np.array([0, 5_000_000, 10_000_000])), [0, 5_050_000_000, 10_100_000_000])
