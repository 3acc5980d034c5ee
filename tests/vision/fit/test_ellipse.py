"""Images of discs."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.vision.fit.ellipse import ellipse
from derivatives import check_derivative


def test_ellipse_encloses_its_area() -> None:
    """An ellipse's values add up to the area of its outline, whatever its axes."""
    xy = np.stack(np.meshgrid(np.arange(-40, 41), np.arange(-40, 41)), -1).reshape(1, -1, 2).astype(float)
    q = np.array([[0.3, 0.1, np.log(15), 0.3, np.log(12), np.log(0.7)]])
    assert ellipse(q, xy).sum() == pytest.approx(np.pi * 15 * 12, rel=5e-3)


def test_derivatives() -> None:
    """Derivatives are those of the values, as far as differences can tell."""
    q = np.array([[0.3, 0.1, np.log(6), 0.2, np.log(5), np.log(0.7)]])
    xy = np.random.default_rng(0).normal(0, 4, (1, 60, 2))
    _, derivatives = ellipse.linearise_shape(q, xy, 6)

    def moved(step: Array) -> Array:
        return ellipse(q + step, xy)[0]

    check_derivative(moved, np.moveaxis(derivatives[0], 0, -1), step=3e-3, tolerance=1e-4)
