"""Points of a rigid body."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.targets.points import KIND, has_several_points, points_target


def test_ids_are_indices():
    """Points as listed, counted from zero, not found in images."""
    target = points_target([[0, 0, 0], [0.1, 0, -0.0]])
    assert target.ids.tolist() == [0, 1]
    assert target.options == {"points_m": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]}
    assert target.found_by is None


@pytest.mark.parametrize(("fields", "many"), [({}, 0), ({"points_m": [[1]]}, 0), ({"points_m": [[1], [2]]}, 1)])
def test_one_or_several(fields, many):
    """More than one point makes a body with a rotation."""
    assert has_several_points(fields) == many
    assert has_several_points({"points_m": 5}) is False


def test_points_are_needed():
    """An entry without points says what is missing."""
    with pytest.raises(ValidationError, match="kind points needs points_m"):
        KIND.entries[0].model_validate({"on": "hand", "kind": "points"})


def test_usual_points_are_never_in_a_plane():
    """Five to eight points, the corners of a cube of 12 cm but for 2 cm."""
    for seed in range(50):
        points = KIND.usual(np.random.default_rng(seed)).points
        assert 5 <= len(points) <= 8
        assert np.all(np.abs(np.abs(points) - 0.06) <= 0.02)
        assert np.linalg.svd(points - points.mean(0), compute_uv=False)[2] > 0.01
