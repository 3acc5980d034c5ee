"""Candidates one by one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from basecal.effects.faces.candidates import Candidates, combine_candidates, one_candidate


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


def test_all_of_a_kind_may_be_one_with_the_sizes_of_all():
    """In their order; what none of them moves stays without."""
    moves = np.arange(48.0).reshape(2, 2, 6, 2)
    joined = Candidates("drift", ("eye", "hand"), (None, 4), "m", (moves, None)).join_sizes()
    assert (joined.about, joined.sizes, joined.moves[1]) == (("eye",), 4, None)
    np.testing.assert_array_equal(joined.moves[0][:, 0], np.concatenate([moves[:, 0], moves[:, 1]], axis=-1))


def test_candidates_of_several_kinds_are_one():
    """A group that one of them does not move stays by its sizes; one that none moves has all the same."""
    views = SimpleNamespace(groups=([0] * 2, [0] * 3))
    first, second = np.ones((2, 6, 2)), 2 * np.ones((3, 6, 1))
    both = combine_candidates(
        [one_candidate("a", "eye", "m", (first, None)), one_candidate("b", "eye", "m", (None, second))], views
    )
    assert [of.shape for of in both.moves] == [(2, 1, 6, 3), (3, 1, 6, 3)]
    np.testing.assert_array_equal(both.moves[0][:, 0], first @ np.eye(2, 3))
    np.testing.assert_array_equal(both.moves[1][:, 0], second @ np.eye(3)[2:])
