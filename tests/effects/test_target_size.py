"""Tests of a target whose size differs from the stated one."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.target_size import candidates, size_moves
from basecal.geometry import SE3
from basecal.simulation import Scenario
from made_views import Made, views_of


def test_larger_target_appears_nearer():
    """A target larger by a millionth appears nearer by a millionth of its distance; nothing rotates."""
    of = views_of(Scenario(samples=12))
    at = of.state.camera_from_target(of.problem.groups[0], of.problem.stops)
    nearer = SE3(at.rotation, (1 - 1e-6) * at.translation)
    np.testing.assert_allclose(1e-6 * size_moves(of, 0)[..., 0], (at.inverse() @ nearer).log(), atol=1e-12)


def test_led_has_no_size_candidate():
    """An LED is a single point, so it has no size."""
    assert list(candidates(views_of(Scenario(samples=8, target="led")))) == []


@pytest.mark.parametrize("targets", [("board", "light"), ("board",), ()])
def test_each_target_size_moves_its_own_views(targets):
    """Each target's size moves only its own views, along their distance."""
    of = Made(4, {"eye": "eye"}, {"target": "light", "mount": "bulb"}, targets=targets)
    found = {each.about[0]: each.moves for each in candidates(of)}
    assert tuple(found) == targets
    for k, name in enumerate(("board", "light")):
        if name in found:
            assert found[name][1 - k] is None
            np.testing.assert_array_equal(found[name][k][:, 0, :, 0], np.tile([0, 0, k + 1.0, 0, 0, 0], (4, 1)))
