"""Tests of the defaults of observations and recordings."""

from __future__ import annotations

import numpy as np

from basecal.cell import CandidateObservation, PixelObservation, Recording, RobotState, Sample
from basecal.cell.recording import TouchObservation
from basecal.geometry import SE3


def test_sigma_is_unset_by_default():
    """Observations have no sigma and are not marked as a detector's own by default."""
    seen = PixelObservation("camera", "board", np.zeros(1, dtype=np.int64), np.zeros((1, 2)))
    spots = CandidateObservation("camera", "light", np.zeros((1, 2)))
    for observation in (seen, spots):
        assert observation.sigma_px is None
        assert observation.detected is False


def test_recording_is_empty_by_default():
    """A recording starts without samples, findings or folder; a sample has only its number."""
    assert (Recording().samples, Recording().findings, Recording().folder) == ((), (), None)
    sample = Sample(3)
    assert (sample.stamp_s, dict(sample.robots), sample.observations) == (None, {}, ())
    assert (dict(sample.images), dict(sample.background)) == ({}, {})


def test_images_are_found_by_sample_and_camera():
    """Image paths are keyed by sample number and camera, whatever the order in the file.

    Samples without images have none.
    """
    samples = (
        Sample(7, images={"left": "images/a.png", "right": "images/b.png"}),
        Sample(3),
        Sample(2, images={"left": "c"}),
    )
    assert Recording(samples).image_paths() == {
        (7, "left"): "images/a.png",
        (7, "right"): "images/b.png",
        (2, "left"): "c",
    }


def test_state_vector_has_joints_or_pose():
    """The vector of a joint state is its joints; that of a pose is its position and rotation matrix."""
    assert RobotState(joints_rad=np.array([1.0, 2.0])).vector.tolist() == [1.0, 2.0]
    pose = SE3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]))
    np.testing.assert_array_equal(RobotState(pose).vector, [*pose.translation, *pose.rotation.ravel()])


def test_state_is_restored_from_vector():
    """Joints are taken unchanged; an inexact rotation matrix becomes the nearest rotation."""
    assert RobotState(joints_rad=np.zeros(2)).with_vector(np.array([1.0, 2.0])).joints_rad.tolist() == [1.0, 2.0]
    pose = SE3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]))
    off = np.concatenate([pose.translation, 1.01 * pose.rotation.ravel()])
    found = RobotState(SE3.identity()).with_vector(off).base_from_flange
    np.testing.assert_allclose(found.matrix, pose.matrix, atol=1e-12)


def test_touch_stores_tip_and_mark():
    """The tip is in the camera's field and the touched mark in the target's."""
    touch = TouchObservation("eye_tip", "mark_a", 1e-4)
    assert (touch.camera, touch.target, touch.kind) == ("eye_tip", "mark_a", "touch")


def test_repr_shows_sample_and_view_counts():
    """The `repr` is one line with the numbers of samples and views."""
    touch = TouchObservation("eye_tip", "mark_a")
    assert repr(Recording((Sample(0, observations=(touch, touch)), Sample(1)))) == "<recording of 2 samples, 2 views>"
