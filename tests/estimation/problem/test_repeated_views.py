"""Contents of views, and what is said of copies."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.problem.repeated_views import repeated_views, view_content
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
def test_contents_are_equal_for_copies_alone(target):
    """Another view, another stop, another number in the last bit, is another content."""
    made = simulate(Scenario(samples=3, target=target), 0)
    first, second = (s.observations[0] for s in made.recording.samples[:2])
    assert view_content(first, (0, 1)) == view_content(replace(first), (0, 1))
    assert view_content(first, (0, 1)) != view_content(second, (0, 1))
    assert view_content(first, (0, 1)) != view_content(first, (0, 2))
    if target == "charuco":
        nearly = replace(first, pixels=np.nextafter(first.pixels, np.inf))
        assert view_content(first, (0, 1)) != view_content(nearly, (0, 1))


def test_many_copies_are_listed_up_to_ten():
    """The count is told whole, and nothing is said of none."""
    assert repeated_views([]) == []
    (finding,) = repeated_views(list(range(12)))
    assert finding.code == "duplicate-samples"
    assert finding.message.startswith("12 views, of sample 0")
    (single,) = repeated_views([4])
    assert single.message.startswith("The view of sample 4 repeats that of an earlier sample")
    assert "remove them" in single.message
    assert "8, 9, ..." in finding.message
    assert "10, ..." not in finding.message
    (ten,) = repeated_views(list(range(10)))
    assert "..." not in ten.message
    assert ten.about == tuple("0123456789")
