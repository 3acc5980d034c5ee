"""Tests of the order of sigmas, each found by its source."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.noise.sigma_places import SigmaPlaces

VIEWS = (("left", "pose_m"), ("right", "pixel_px"))


@pytest.mark.parametrize("kinds", [0, 1, 2])
def test_sigmas_are_in_sequence(kinds):
    """The order is views, a pair for each robot, jitter, and a pair for each type of shared errors of each robot."""
    places = SigmaPlaces.sequential(VIEWS, ("eye", "hand"), ("left",), kinds)
    assert places.views == {VIEWS[0]: 0, VIEWS[1]: 1}
    assert places.stops == {"eye": slice(2, 4), "hand": slice(4, 6)}
    assert places.jitter == {"left": 6}
    pairs = {"eye": slice(7, 9), "hand": slice(9, 11)}, {"eye": slice(11, 13), "hand": slice(13, 15)}
    assert places.shared == pairs[:kinds]
    assert places.count == 7 + 4 * kinds
    np.testing.assert_array_equal(places.is_of_views, np.arange(places.count) < 2)


def test_empty_sigma_places():
    """Without open sigmas of views or robots there are no places."""
    nothing = SigmaPlaces.sequential((), (), (), 1)
    assert (nothing.count, nothing.is_of_views.tolist(), nothing.shared) == (0, [], ({},))
