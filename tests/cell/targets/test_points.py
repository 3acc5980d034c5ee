"""Tests of points of a rigid body."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.targets.points import KIND, has_several_points, points_target


def test_point_ids_are_indices():
    """Points keep their listed order, are counted from zero, and are not detected in images."""
    target = points_target([[0, 0, 0], [0.1, 0, -0.0]])
    assert target.ids.tolist() == [0, 1]
    assert target.options == {"points_m": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]}
    assert target.found_by is None


@pytest.mark.parametrize(("fields", "many"), [({}, 0), ({"points_m": [[1]]}, 0), ({"points_m": [[1], [2]]}, 1)])
def test_several_points_make_a_body(fields, many):
    """More than one point makes a body with a rotation."""
    assert has_several_points(fields) == many
    assert has_several_points({"points_m": 5}) is False


def test_points_are_required():
    """The error for an entry without points states what is missing."""
    with pytest.raises(ValidationError, match="kind points needs points_m"):
        KIND.entries[0].model_validate({"on": "hand", "kind": "points"})


def test_usual_points_are_not_coplanar():
    """The usual body has five to eight points, within 2 cm of the corners of a cube of 12 cm."""
    for seed in range(50):
        points = KIND.usual(np.random.default_rng(seed)).points
        assert 5 <= len(points) <= 8
        assert np.all(np.abs(np.abs(points) - 0.06) <= 0.02)
        assert np.linalg.svd(points - points.mean(0), compute_uv=False)[2] > 0.01
