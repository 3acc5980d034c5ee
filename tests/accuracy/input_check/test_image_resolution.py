"""Camera matrices of images of another resolution."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.input_check.image_resolution import other_resolution
from basecal.cell import CellCamera, Intrinsics
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Camera

PIXELS = np.array([[[10.0, 20.0], [1200.0, 690.0], [5000.0, 5000.0]]])
SEEN = np.array([[True, True, False]])
VIEWS = PixelMeasurement(np.zeros((3, 3)), PIXELS, SEEN, np.ones((1, 3)), np.ones((1, 3)))
OTHERS = SimpleNamespace(camera="other", measurement=replace(VIEWS, pixels=9 * PIXELS))
PROBLEM = SimpleNamespace(groups=(SimpleNamespace(camera="wrist", measurement=VIEWS), OTHERS))


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
    found = other_resolution(camera(center, size_px), PROBLEM)
    assert re.search(clause, found) if clause else found == ""


def test_without_a_lens_nothing_is_said():
    """A camera that gives poses has no camera matrix."""
    assert other_resolution(CellCamera("wrist", "eye"), PROBLEM) == ""


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ((1.24, 1.24), False),
        ((1.26, 1.26), True),
        ((0.81, 0.81), False),
        ((0.79, 0.79), True),
        ((2.0, 2.28), True),
        ((2.0, 2.38), False),
    ],
)
def test_a_quarter_is_another_resolution_and_both_sides_agree(factors, told):
    """To a seventh of one another; the size is that of the images by the mean of both factors."""
    center = np.array(factors) * np.array([1280, 720]) / 2 - 0.5
    found = other_resolution(camera(center, (1280, 720)), PROBLEM)
    mean = np.sqrt(factors[0] * factors[1])
    size = f"{1280 * mean:.0f} x {720 * mean:.0f} px"
    said = f": its camera matrix looks like that of images of about {size}, not of 1280 x 720 px"
    assert found == (said if told else "")


@pytest.mark.parametrize(("center", "told"), [((479.6, 275.4), False), ((479.4, 275.4), True), ((479.4, 275.6), False)])
def test_points_reach_beyond_smaller_images(center, told):
    """A quarter beyond twice the centre both ways, by the pixels of this camera alone."""
    found = other_resolution(camera(center, None), PROBLEM)
    assert found == (": points reach to (1200, 690) px, its camera matrix is of smaller images" if told else "")
