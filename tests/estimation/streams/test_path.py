"""Tests of a robot's path between its records."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from basecal.estimation.streams.path import LARGEST_GAP_S, Path
from basecal.geometry import SE3
from planar_arm import planar
from stream_cells import path_poses


def path_error(path: Path, times: np.ndarray) -> float:
    """The largest deviation from the true flange pose, in any coordinate."""
    return float(np.abs((path_poses(times).inverse() @ path.evaluate(times).base_from_flange).log()).max())


def record_path(rate: float) -> Path:
    times = np.arange(0.0, 4.0, 1 / rate)
    return Path(times, path_poses(times))


def test_path_passes_through_its_records() -> None:
    """At the times of records the path has their poses."""
    path = record_path(20.0)
    assert path_error(path, path.times) < 1e-12


def test_path_is_of_third_order_between_records() -> None:
    """Half the spacing leaves an eighth of the error of smooth motion. A line would leave a quarter."""
    times = np.linspace(1.0, 3.0, 777)
    coarse, fine = path_error(record_path(10.0), times), path_error(record_path(20.0), times)
    assert fine < 1e-4
    assert 6.0 < coarse / fine < 20.0


def test_path_velocity_is_the_derivative() -> None:
    """The velocity equals central differences of the pose."""
    path, times, step = record_path(20.0), np.linspace(1.003, 3.0, 41), 1e-6
    before, after = path.evaluate(times - step).base_from_flange, path.evaluate(times + step).base_from_flange
    np.testing.assert_allclose(path.evaluate(times).velocity, (before.inverse() @ after).log() / (2 * step), atol=1e-6)


def test_records_at_unequal_times_are_interpolated() -> None:
    """With random times, the path is right to 2e-3."""
    times = np.sort(np.random.default_rng(3).uniform(0.0, 4.0, 200))
    assert path_error(Path(times, path_poses(times)), np.linspace(0.5, 3.5, 99)) < 2e-3


def test_path_is_unknown_within_a_gap() -> None:
    """Times in a gap, and outside of the records, are not known."""
    times = np.concatenate([np.arange(0.0, 1.0, 0.05), np.arange(2.0, 3.0, 0.05)])
    path = Path(times, path_poses(times))
    np.testing.assert_array_equal(path.known_mask(np.array([-0.1, 0.5, 1.2, 1.5, 2.5, 3.5])), [0, 1, 0, 0, 1, 0])


def test_slopes_beside_a_gap_are_one_sided() -> None:
    """Near a gap, slopes use records of their own side only."""
    times = np.concatenate([np.arange(0.0, 1.0, 0.05), np.arange(2.0, 3.0, 0.05)])
    near = np.array([0.93, 2.02])
    assert path_error(Path(times, path_poses(times)), near) < 1e-3


def test_isolated_record_is_of_a_still_robot() -> None:
    """Near an isolated record the robot has its pose and no velocity."""
    times = np.array([0.0, 5.0, 10.0])
    path = Path(times, path_poses(times))
    asked = np.array([4.9, 5.2, 10.1, 6.0])
    np.testing.assert_array_equal(path.known_mask(asked), [1, 1, 1, 0])
    there = path.evaluate(asked[:3])
    np.testing.assert_array_equal(there.velocity, 0.0)
    np.testing.assert_allclose(there.base_from_flange.matrix, path_poses(times[[1, 1, 2]]).matrix, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_records_give_no_path(count: int) -> None:
    """A path with no record, or with one, is known at no time."""
    path = Path(np.arange(count, dtype=float), SE3.identity((count,)))
    assert not path.known_mask(np.array([0.0, LARGEST_GAP_S])).any()


def test_joints_are_interpolated_in_joint_space() -> None:
    """If records are far apart, the flange moves along a curve that only the joints determine."""
    chain = planar(0.4, 0.3, 0.2)
    times = np.arange(0.0, 2.0, 0.1)
    joints = np.sin(times)[:, None] * np.linspace(0.5, 1.5, chain.n)
    path = Path(times, chain.forward(joints), joints, chain)
    asked = np.linspace(0.3, 1.6, 29)
    there = path.evaluate(asked)
    assert there.joints is not None
    np.testing.assert_allclose(there.joints, np.sin(asked)[:, None] * np.linspace(0.5, 1.5, chain.n), atol=2e-4)
    np.testing.assert_allclose(there.base_from_flange.matrix, chain.forward(there.joints).matrix, atol=1e-12)
    step = 1e-6
    moved = path.evaluate(asked - step).base_from_flange.inverse() @ path.evaluate(asked + step).base_from_flange
    np.testing.assert_allclose(there.velocity, moved.log() / (2 * step), atol=1e-6)


@pytest.mark.parametrize("by_joints", [False, True])
def test_path_is_a_cubic_hermite_spline(by_joints: bool) -> None:
    """Positions and velocities equal SciPy's spline, for unequal times, one-sided at both ends and beside a gap."""
    times = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 1.5, 1.6, 1.85, 1.9])
    values = np.random.default_rng(2).uniform(-1, 1, (len(times), 3))
    before, after = np.array([0, 0, 1, 2, 3, 5, 5, 6, 7]), np.array([1, 2, 3, 4, 4, 6, 7, 8, 8])
    slopes = (values[after] - values[before]) / (times[after] - times[before])[:, None]
    spline = CubicHermiteSpline(times, values, slopes[:, None].reshape(values.shape))
    asked = np.array([0.0, 0.03, 0.1, 0.2, 0.27, 0.35, 0.49, 0.5, 1.5, 1.55, 1.7, 1.8, 1.88, 1.9])
    if by_joints:
        chain = planar(0.4, 0.3, 0.2)
        there = Path(times, chain.forward(values), values, chain).evaluate(asked)
        np.testing.assert_allclose(there.joints, spline(asked), atol=1e-12)
        at = chain.posture(spline(asked))
        expected = (at.joint_derivative @ spline(asked, 1)[..., None])[..., 0]
        np.testing.assert_allclose(there.base_from_flange.matrix, at.base_from_flange.matrix, atol=1e-12)
    else:
        turn = np.broadcast_to(SE3.exp([0, 0, 0, 0.3, -0.2, 1.0]).rotation, (len(times), 3, 3))
        there = Path(times, SE3(turn, values)).evaluate(asked)
        assert there.joints is None
        np.testing.assert_allclose(there.base_from_flange.translation, spline(asked), atol=1e-12)
        np.testing.assert_allclose(there.base_from_flange.rotation, turn[0][None].repeat(len(asked), 0), atol=1e-12)
        expected = np.hstack([spline(asked, 1) @ turn[0], np.zeros((len(asked), 3))])
    np.testing.assert_allclose(there.velocity, expected, atol=1e-10)


def test_gaps_up_to_a_limit_are_interpolated() -> None:
    """Gaps up to a quarter of a second are interpolated, and both ends of a path belong to it.

    A record without such neighbours is of a robot that is still, for as long.
    """
    path = Path(np.array([0.0, 0.25, 0.5, 1.0, 1.251953125]), SE3.identity((5,)))
    np.testing.assert_array_equal(path.steady_intervals, [True, True, False, False])
    np.testing.assert_array_equal(path.isolated_records, [False, False, False, True, True])
    asked = [-0.001, 0.0, 0.25, 0.4, 0.5, 0.6, 0.749, 0.751, 1.25, 1.5, 1.51]
    np.testing.assert_array_equal(path.known_mask(np.array(asked)), [0, 1, 1, 1, 1, 0, 0, 1, 1, 1, 0])


def test_still_robot_is_at_the_nearer_record() -> None:
    """Just before the middle it is at the first record, just after it at the second."""
    times = np.array([0.0, 0.4, 0.8])
    path = Path(times, path_poses(times))
    there = path.evaluate(np.array([0.19, 0.21, 0.61, 1.0])).base_from_flange
    np.testing.assert_allclose(there.matrix, path_poses(times[[0, 1, 2, 2]]).matrix, atol=1e-12)
