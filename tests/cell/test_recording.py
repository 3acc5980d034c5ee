"""What an observation is where nothing else is said."""

from __future__ import annotations

import numpy as np

from basecal.cell import CandidateObservation, PixelObservation, Recording, RobotState, Sample
from basecal.cell.recording import TouchObservation
from basecal.geometry import SE3


def test_sigmas_are_stated_ones_unless_said():
    """A detector's own are marked; neither is there by itself."""
    seen = PixelObservation("camera", "board", np.zeros(1, dtype=np.int64), np.zeros((1, 2)))
    spots = CandidateObservation("camera", "light", np.zeros((1, 2)))
    for observation in (seen, spots):
        assert observation.sigma_px is None
        assert observation.detected is False


def test_a_recording_is_empty_until_something_is_recorded():
    """Neither samples nor findings, and no folder; a sample knows its number alone."""
    assert (Recording().samples, Recording().findings, Recording().folder) == ((), (), None)
    sample = Sample(3)
    assert (sample.stamp_s, dict(sample.robots), sample.observations) == (None, {}, ())
    assert (dict(sample.images), dict(sample.background)) == ({}, {})


def test_images_are_found_by_sample_and_camera():
    """Each under its own number, whatever its place in the file; samples without images have none."""
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


def test_a_vector_holds_all_of_a_state():
    """Joints stay as they are; a pose is its position and its rotation matrix."""
    assert RobotState(joints_rad=np.array([1.0, 2.0])).vector.tolist() == [1.0, 2.0]
    pose = SE3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]))
    np.testing.assert_array_equal(RobotState(pose).vector, [*pose.translation, *pose.rotation.ravel()])


def test_a_vector_is_a_state_of_the_same_kind():
    """Joints stay as they are; a rotation that is none quite becomes the nearest one."""
    assert RobotState(joints_rad=np.zeros(2)).with_vector(np.array([1.0, 2.0])).joints_rad.tolist() == [1.0, 2.0]
    pose = SE3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]))
    off = np.concatenate([pose.translation, 1.01 * pose.rotation.ravel()])
    found = RobotState(SE3.identity()).with_vector(off).base_from_flange
    np.testing.assert_allclose(found.matrix, pose.matrix, atol=1e-12)


def test_a_touch_is_of_a_tip_and_what_it_meets():
    """In the places of a camera and of a target."""
    touch = TouchObservation("eye_tip", "mark_a", 1e-4)
    assert (touch.camera, touch.target, touch.kind) == ("eye_tip", "mark_a", "touch")


def test_a_recording_is_a_line():
    """How many samples and views it has."""
    touch = TouchObservation("eye_tip", "mark_a")
    assert repr(Recording((Sample(0, observations=(touch, touch)), Sample(1)))) == "<recording of 2 samples, 2 views>"
