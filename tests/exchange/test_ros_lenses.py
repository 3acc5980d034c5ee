"""Lenses as ROS calls them."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange.ros_lenses import ros_lens
from basecal.geometry import Camera


@pytest.mark.parametrize(
    ("model", "terms", "name", "count"),
    [
        ("pinhole", 0, "plumb_bob", 5),
        ("pinhole", 4, "plumb_bob", 5),
        ("pinhole", 5, "plumb_bob", 5),
        ("pinhole", 8, "rational_polynomial", 8),
        ("fisheye", 4, "equidistant", 4),
    ],
)
def test_terms_that_ours_leaves_out_are_zero(model, terms, name, count):
    """The others stay in their order."""
    distortion = 0.01 * np.arange(1, terms + 1)
    named, full = ros_lens(Camera(model, np.concatenate([[800, 800, 320, 240], distortion])))
    assert (named, len(full)) == (name, count)
    np.testing.assert_array_equal(full[:terms], distortion)
    assert not np.any(full[terms:])


def test_a_lens_that_ros_does_not_have_is_said():
    """A thin prism."""
    with pytest.raises(InputError, match="ROS has no name for a pinhole lens with 12"):
        ros_lens(Camera("pinhole", np.array([800, 800, 320, 240, *np.full(12, 0.01)])))
