"""Streams put side by side."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import PixelObservation, PoseObservation
from basecal.errors import InputError
from basecal.exchange.assemble import recording_from_streams
from basecal.exchange.controller_poses import PoseStream
from basecal.geometry import SE3


def stream(name: str, count: int, seed: int) -> PoseStream:
    return PoseStream(name, SE3.exp(np.random.default_rng(seed).normal(size=(count, 6))), np.arange(count) * 0.5)


def test_sample_i_holds_row_i() -> None:
    """Sample i has the i-th pose of every stream, its stamp, and the pixels given for i."""
    eye, hand, seen = stream("a", 3, 0), stream("c", 3, 1), stream("b", 3, 2)
    pixels = {1: (np.array([4]), np.array([[7.0, 8.0]]))}
    recording = recording_from_streams({"eye": eye, "hand": hand}, "camera", "target", seen, pixels, sigma_px=0.4)
    assert [sample.sample for sample in recording.samples] == [0, 1, 2]
    sample = recording.samples[1]
    pose, points = sample.observations
    assert sample.stamp_s == 0.5
    assert isinstance(pose, PoseObservation)
    assert isinstance(points, PixelObservation)
    np.testing.assert_array_equal(sample.robots["hand"].base_from_flange.matrix, hand.poses[1].matrix)
    np.testing.assert_array_equal(pose.camera_from_target.matrix, seen.poses[1].matrix)
    np.testing.assert_array_equal(points.pixels, [[7, 8]])
    np.testing.assert_array_equal(points.sigma_px, [0.4])
    assert len(recording.samples[0].observations) == 1


def test_lengths_must_agree() -> None:
    """Files of different length are refused, each with its length."""
    with pytest.raises(InputError, match=r"a\.txt holds 3, c\.txt holds 4"):
        recording_from_streams({"eye": stream("a.txt", 3, 0), "hand": stream("c.txt", 4, 1)}, "camera", "target")


def test_a_robot_of_one_pose_stands_still() -> None:
    """Its pose is of every sample, and the times are those of what moves."""
    moving, still = stream("a", 3, 0), stream("c", 1, 1)
    samples = recording_from_streams({"hand": still, "eye": moving}, "camera", "target").samples
    assert [sample.stamp_s for sample in samples] == [0, 0.5, 1]
    for sample in samples:
        np.testing.assert_array_equal(sample.robots["hand"].base_from_flange.matrix, still.poses[0].matrix)


def test_pixels_must_have_a_pose() -> None:
    """Pixels of a sample past the last pose are refused."""
    pixels = {3: (np.array([0]), np.array([[1.0, 2.0]]))}
    with pytest.raises(InputError, match="sample 3, but the poses end at sample 2"):
        recording_from_streams({"eye": stream("a", 3, 0)}, "camera", "target", pixels=pixels)


def test_some_robot_is_needed() -> None:
    """Without any stream there is no sample to make."""
    with pytest.raises(InputError, match="no pose file"):
        recording_from_streams({}, "camera", "target")
