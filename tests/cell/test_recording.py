"""What an observation is where nothing else is said."""

from __future__ import annotations

import numpy as np

from basecal.cell import CandidateObservation, PixelObservation, Recording, Sample
from basecal.cell.recording import TouchObservation


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


def test_a_touch_is_of_a_tip_and_what_it_meets():
    """In the places of a camera and of a target."""
    touch = TouchObservation("eye_tip", "mark_a", 1e-4)
    assert (touch.camera, touch.target, touch.kind) == ("eye_tip", "mark_a", "touch")


def test_a_recording_is_a_line():
    """How many samples and views it has."""
    touch = TouchObservation("eye_tip", "mark_a")
    assert repr(Recording((Sample(0, observations=(touch, touch)), Sample(1)))) == "<recording of 2 samples, 2 views>"
