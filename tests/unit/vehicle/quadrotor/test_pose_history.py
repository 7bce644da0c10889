import numpy as np

from vehicle.quadrotor.pose_history import PoseAt, PoseHistory


def _pose(x: float, yaw: float = 0.0, speed: float = 1.0, yaw_rate: float = 0.0) -> PoseAt:
    return PoseAt(
        np.array([x, 0.0, 1.0]),
        np.array([speed, 0.0, 0.0]),
        np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]),
        np.array([0.0, 0.0, yaw_rate]),
    )


def test_pose_history_interpolates_across_the_quaternion_sign():
    history = PoseHistory()
    history.add(0, _pose(0.0, 0.0))
    flipped = _pose(1.0, 0.2)
    history.add(10, flipped._replace(orientation=-flipped.orientation))
    middle = history.at(5)
    assert middle is not None
    assert np.allclose(middle.position, [0.5, 0, 1])
    assert np.allclose(middle.orientation, _pose(0, 0.1).orientation, atol=1e-5)


def test_pose_history_extrapolates_with_the_twist_up_to_a_limit():
    history = PoseHistory(extrapolate_ns=30_000_000)
    history.add(0, _pose(0.0, yaw=0.3, speed=2.0, yaw_rate=1.0))
    ahead = history.at(10_000_000)
    assert ahead is not None
    assert np.allclose(ahead.position, [0.02, 0, 1])
    assert np.allclose(ahead.orientation, _pose(0, 0.31).orientation, atol=1e-4)
    assert history.at(31_000_000) is None


def test_times_outside_the_history_and_non_finite_samples_are_refused():
    history = PoseHistory(span_ns=100)
    assert history.at(0) is None
    assert history.add(1000, _pose(0.0))
    assert not history.add(1000, _pose(1.0))
    assert not history.add(1001, _pose(float("nan")))
    assert history.at(999) is None
    history.add(2000, _pose(2.0))
    assert history.at(1500) is None


def test_sample_stamped_later_than_now_is_refused_and_does_not_block_later_ones():
    history = PoseHistory()
    assert history.add(1_000_000, _pose(0.0), 2_000_000)
    assert not history.add(3_600_000_000_000, _pose(1.0), 3_000_000)
    assert history.add(4_000_000, _pose(2.0), 4_000_000)
    assert history.at(4_000_000) is not None


def test_sample_without_a_unit_quaternion_is_refused():
    assert not PoseHistory().add(0, _pose(0.0)._replace(orientation=np.zeros(4)))
