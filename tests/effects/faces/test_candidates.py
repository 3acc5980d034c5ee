"""Candidates one by one."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.candidates import Candidates, one_candidate


def test_one_of_several_has_what_is_its_own():
    """Its name, its first sample and its moves, as candidates of one."""
    moves = (np.arange(24.0).reshape(2, 2, 6, 1), np.arange(36.0).reshape(3, 2, 6, 1))
    one = Candidates("drift", ("eye", "hand"), (None, 4), "m", moves).single(1)
    assert (one.code, one.about, one.since, one.unit) == ("drift", ("hand",), (4,), "m")
    assert one.joint == ()
    assert Candidates("joint-offset", ("eye",) * 2, (None,) * 2, "rad", moves, (0, 3)).single(1).joint == (3,)
    for part, whole in zip(one.moves, moves, strict=True):
        np.testing.assert_array_equal(part, whole[:, [1]])


def test_one_candidate_has_moves_of_one():
    """Groups that it does not move stay without."""
    found = one_candidate("drift", "eye", "m", (np.ones((3, 6, 2)), None))
    assert (found.about, found.since, found.sizes, found.moves[1]) == (("eye",), (None,), 2, None)
    assert found.moves[0].shape == (3, 1, 6, 2)
