"""Contours of a lens's uncertainty."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from basecal.geometry import Camera
from basecal.reporting.figures.lens_uncertainty import lens_uncertainty

CAMERA = Camera("pinhole", np.array([900.0, 910.0, 630.0, 360.0, -0.1, 0.05, 1e-3, -1e-3, 0.01]), (1280, 720))
COVARIANCE = np.diag(np.array([1.0, 1.0, 2.0, 2.0, 2e-3, 3e-3, 1e-4, 1e-4, 3e-3]) ** 2)


def test_a_lens_has_contours_over_its_image() -> None:
    """A square for each part of the image, shaded from the least to the most, and lines with their values."""
    figure = lens_uncertainty("wrist", CAMERA, COVARIANCE)
    assert figure is not None
    assert figure.title == "wrist, uncertainty of the lens"
    assert figure.svg.count('class="tile"') == 16 * 9
    assert 'fill-opacity="0.12"' in figure.svg
    assert 'fill-opacity="1.00"' in figure.svg
    assert figure.svg.count('class="contour-label"') >= 3


def test_contours_lie_over_the_whole_image() -> None:
    """The drawing is 640 wide and 360 high, without what stands below the image."""
    figure = lens_uncertainty("wrist", CAMERA, COVARIANCE)
    (lines,) = re.findall(r'class="contour" d="([^"]*)"', figure.svg)
    places = np.array([float(number) for number in re.findall(r"[-0-9.]+", lines)]).reshape(-1, 2)
    assert places.min() >= 0
    assert np.all(places.max(0) <= [640, 360])
    assert np.all(np.ptp(places, axis=0) > [500, 250])


def test_without_a_size_there_is_no_image() -> None:
    """Nor is there a map of it; one of an exact lens has no lines."""
    assert lens_uncertainty("wrist", replace(CAMERA, size_px=None), COVARIANCE) is None
    exact = lens_uncertainty("wrist", CAMERA, 0 * COVARIANCE)
    assert exact is not None
    assert "contour" not in exact.svg
