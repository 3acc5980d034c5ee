"""Camera matrices of images of another resolution."""

import re

import numpy as np
import pytest

from basecal.accuracy.input_check.image_resolution import other_resolution
from basecal.cell import CellCamera, Intrinsics, PixelObservation, Recording, Sample
from basecal.geometry import Camera

SEEN = PixelObservation("wrist", "board", np.arange(2), np.array([[10.0, 20.0], [1200.0, 690.0]]))
RECORDING = Recording((Sample(0, observations=(SEEN,)),))


def camera(center, size_px):
    lens = Camera("pinhole", np.array([900.0, 900.0, *center]))
    return CellCamera("wrist", "eye", size_px=size_px, intrinsics=Intrinsics("fixed", lens))


@pytest.mark.parametrize(
    ("center", "size_px", "clause"),
    [
        ((643, 354), (1280, 720), ""),
        ((643, 354), None, ""),
        ((320, 354), (1280, 720), ""),  # a part cut out of an image
        ((322, 177), (1280, 720), "looks like that of images of about 6.. x 3.. px, not of 1280 x 720 px"),
        ((1286, 708), (1280, 720), "looks like that of images of about 25.. x 14.. px, not of"),
        ((322, 177), None, r"points reach to \(1200, 690\) px, its camera matrix is of smaller images"),
        ((-5, -5), (1280, 720), ""),
    ],
)
def test_another_resolution_is_named(center, size_px, clause):
    """Where the centre lies at one share of the middle both ways, and it is another."""
    found = other_resolution(camera(center, size_px), RECORDING)
    assert re.search(clause, found) if clause else found == ""


def test_without_a_lens_nothing_is_said():
    """A camera that gives poses has no camera matrix."""
    assert other_resolution(CellCamera("wrist", "eye"), RECORDING) == ""
