"""Places of sigmas: one after the other, each found by what it is of."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.noise.sigma_places import SigmaPlaces

VIEWS = (("left", "pose_m"), ("right", "pixel_px"))


@pytest.mark.parametrize("has_shared", [True, False])
def test_sigmas_stand_one_after_the_other(has_shared):
    """Of views, a pair of each robot, jitter, and a pair of what each robot's stops share if any do."""
    places = SigmaPlaces.sequential(VIEWS, ("eye", "hand"), ("left",), has_shared)
    assert places.views == {VIEWS[0]: 0, VIEWS[1]: 1}
    assert places.stops == {"eye": slice(2, 4), "hand": slice(4, 6)}
    assert places.jitter == {"left": 6}
    assert places.shared == ({"eye": slice(7, 9), "hand": slice(9, 11)} if has_shared else {})
    assert places.count == (11 if has_shared else 7)
    np.testing.assert_array_equal(places.is_of_views, np.arange(places.count) < 2)


def test_nothing_open_has_no_place():
    """Neither of views nor of robots."""
    nothing = SigmaPlaces.sequential((), (), (), True)
    assert (nothing.count, nothing.is_of_views.tolist(), dict(nothing.shared)) == (0, [], {})
