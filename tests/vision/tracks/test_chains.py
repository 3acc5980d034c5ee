"""Matches of pairs of images become tracks."""

from __future__ import annotations

import numpy as np

from basecal.vision.tracks.chains import Chains, chain_matches, longest_chains
from basecal.vision.tracks.matching import Matches


def matches(*pairs: tuple[int, int]) -> Matches:
    """Features of two images."""
    first, second = np.array(pairs).T
    return Matches(first, second)


def tracks_of(found) -> set[frozenset[tuple[int, int]]]:
    """Tracks as sets of (view, feature)."""
    return {
        frozenset(zip(found.view[found.track == k].tolist(), found.feature[found.track == k].tolist(), strict=True))
        for k in range(found.track.max(initial=-1) + 1)
    }


def test_pairs_are_chained() -> None:
    """Feature 2 of image 0, 0 of 1 and 1 of 2 are one track through images 0-1 and 1-2 alone."""
    found = chain_matches([3, 2, 2], {(0, 1): matches((2, 0), (0, 1)), (1, 2): matches((0, 1), (1, 0))}, 3)
    assert tracks_of(found) == {frozenset({(0, 2), (1, 0), (2, 1)}), frozenset({(0, 0), (1, 1), (2, 0)})}


def test_short_tracks_are_left_out() -> None:
    """A track of two images is none if three are needed, and is one if two are."""
    given = {(0, 1): matches((0, 0), (1, 1)), (1, 2): matches((0, 0))}
    assert tracks_of(chain_matches([2, 2, 2], given, 3)) == {frozenset({(0, 0), (1, 0), (2, 0)})}
    assert len(tracks_of(chain_matches([2, 2, 2], given, 2))) == 2


def test_a_image_in_which_a_track_stands_twice_is_left_out() -> None:
    """Two features of image 2 end in one track: it keeps the images 0, 1 and 3, and neither of the two."""
    given = {(0, 1): matches((0, 0)), (0, 2): matches((0, 0)), (1, 2): matches((0, 1)), (0, 3): matches((0, 0))}
    assert tracks_of(chain_matches([1, 1, 2, 1], given, 3)) == {frozenset({(0, 0), (1, 0), (3, 0)})}


def test_without_matches_there_are_no_tracks() -> None:
    """Features alone are no tracks."""
    found = chain_matches([4, 3], {}, 2)
    assert [len(part) for part in found] == [0, 0, 0]


def test_the_longest_tracks_are_kept() -> None:
    """In the order of their numbers, of equal ones the first; all, if there are not more."""
    view = np.array([0, 1, 0, 1, 2, 1, 2, 0, 1, 2])
    track = np.array([0, 0, 1, 1, 1, 2, 2, 3, 3, 3])
    chains = Chains(view, np.arange(10), track)
    two = longest_chains(chains, 2)
    assert two.feature.tolist() == [2, 3, 4, 7, 8, 9]
    assert two.track.tolist() == [0, 0, 0, 1, 1, 1]
    assert two.view.tolist() == [0, 1, 2, 0, 1, 2]
    three = longest_chains(chains, 3)
    assert three.track.tolist() == [0, 0, 1, 1, 1, 2, 2, 2]
    assert three.feature.tolist() == [0, 1, 2, 3, 4, 7, 8, 9]
    assert longest_chains(chains, 9).track.tolist() == track.tolist()


def test_a_track_counts_the_images_in_which_it_is_single() -> None:
    """Of four images with two features in one of them, three are enough; the last feature of the last image counts."""
    given = {(0, 1): matches((0, 0), (1, 1)), (1, 2): matches((0, 0), (1, 1), (0, 2)), (2, 3): matches((0, 0), (1, 1))}
    assert tracks_of(chain_matches([2, 2, 3, 2], given, 3)) == {
        frozenset({(0, 0), (1, 0), (3, 0)}),
        frozenset({(0, 1), (1, 1), (2, 1), (3, 1)}),
    }
    assert tracks_of(chain_matches([2, 2, 3, 2], given, 4)) == {frozenset({(0, 1), (1, 1), (2, 1), (3, 1)})}
    assert tracks_of(chain_matches([1, 1], {(0, 1): matches((0, 0))}, 2)) == {frozenset({(0, 0), (1, 0)})}
