"""Transforms between two clouds of points whose pairs are wrong in part."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.alignment import alignments
from basecal.geometry import SE3
from scene_points import BASE


def clouds(rng, right, wrong):
    """Points of the first arm, their partners in the second, some of which are others."""
    first = rng.uniform(-0.5, 0.5, (right + wrong, 3))
    second = BASE.inverse() @ first + 1e-3 * rng.standard_normal(first.shape)
    second[right:] = rng.uniform(-0.5, 0.5, (wrong, 3)) + BASE.inverse().translation
    return first, second


def test_a_third_of_right_pairs_is_enough():
    """60 of 180 pairs are right: the transform is found to a millimetre."""
    first, second = clouds(np.random.default_rng(1), 60, 120)
    best, agrees = alignments(first, second, np.full(180, 0.01), 5)[0]
    assert np.linalg.norm((BASE @ best).log()) < 3e-3
    assert agrees[:60].mean() > 0.9


def test_a_repeated_object_makes_a_rival():
    """An object that stands twice makes a second transform, told apart from the first."""
    rng = np.random.default_rng(2)
    first, second = clouds(rng, 80, 40)
    twin = SE3.from_rpy((0.0, 0.0, 1.0), (0.3, 0.2, 0.0))
    second[80:] = BASE.inverse() @ (twin @ first[80:])
    found = alignments(first, second, np.full(120, 0.01), 5)
    assert int(found[0][1].sum()) >= 80
    assert found[1][1][80:].mean() > 0.9
    assert np.linalg.norm((twin.inverse() @ BASE @ found[1][0]).log()) < 0.02


def test_pairs_by_chance_align_nothing():
    """Of random pairs no transform has eight that agree within 2 mm."""
    rng = np.random.default_rng(3)
    first, second = rng.uniform(-1, 1, (60, 3)), rng.uniform(-1, 1, (60, 3))
    assert alignments(first, second, np.full(60, 2e-3), 5) == []
    assert alignments(first[:4], second[:4], np.full(4, 1.0), 5) == []
