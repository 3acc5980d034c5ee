"""Tests of tracks chained from matches of image pairs."""

from __future__ import annotations

import numpy as np

from basecal.vision.tracks.chains import Chains, chain_matches, longest_chains
from basecal.vision.tracks.matching import Matches


def matches(*pairs: tuple[int, int]) -> Matches:
    """Matches of features of two images."""
    first, second = np.array(pairs).T
    return Matches(first, second)


def tracks_of(found) -> set[frozenset[tuple[int, int]]]:
    """Tracks as sets of (view, feature)."""
    return {
        frozenset(zip(found.view[found.track == k].tolist(), found.feature[found.track == k].tolist(), strict=True))
        for k in range(found.track.max(initial=-1) + 1)
    }


def test_matches_are_chained_to_tracks() -> None:
    """Feature 2 of image 0, 0 of 1 and 1 of 2 are one track, connected by the pairs 0-1 and 1-2 only."""
    found = chain_matches([3, 2, 2], {(0, 1): matches((2, 0), (0, 1)), (1, 2): matches((0, 1), (1, 0))}, 3)
    assert tracks_of(found) == {frozenset({(0, 2), (1, 0), (2, 1)}), frozenset({(0, 0), (1, 1), (2, 0)})}


def test_short_tracks_are_excluded() -> None:
    """A track of two images is excluded if three are required, and kept if two are."""
    given = {(0, 1): matches((0, 0), (1, 1)), (1, 2): matches((0, 0))}
    assert tracks_of(chain_matches([2, 2, 2], given, 3)) == {frozenset({(0, 0), (1, 0), (2, 0)})}
    assert len(tracks_of(chain_matches([2, 2, 2], given, 2))) == 2


def test_image_with_track_twice_is_excluded() -> None:
    """Two features of image 2 are in one track: it keeps the images 0, 1 and 3, and neither of the two features."""
    given = {(0, 1): matches((0, 0)), (0, 2): matches((0, 0)), (1, 2): matches((0, 1)), (0, 3): matches((0, 0))}
    assert tracks_of(chain_matches([1, 1, 2, 1], given, 3)) == {frozenset({(0, 0), (1, 0), (3, 0)})}


def test_without_matches_there_are_no_tracks() -> None:
    """Features without matches give no tracks."""
    found = chain_matches([4, 3], {}, 2)
    assert [len(part) for part in found] == [0, 0, 0]


def test_longest_tracks_are_kept() -> None:
    """Tracks keep their order, and the first of equal ones is kept. All are kept if there are not more."""
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


def test_track_length_counts_unambiguous_images() -> None:
    """Of four images with two features in one of them, three count.

    The last feature of the last image counts as well.
    """
    given = {(0, 1): matches((0, 0), (1, 1)), (1, 2): matches((0, 0), (1, 1), (0, 2)), (2, 3): matches((0, 0), (1, 1))}
    assert tracks_of(chain_matches([2, 2, 3, 2], given, 3)) == {
        frozenset({(0, 0), (1, 0), (3, 0)}),
        frozenset({(0, 1), (1, 1), (2, 1), (3, 1)}),
    }
    assert tracks_of(chain_matches([2, 2, 3, 2], given, 4)) == {frozenset({(0, 1), (1, 1), (2, 1), (3, 1)})}
    assert tracks_of(chain_matches([1, 1], {(0, 1): matches((0, 0))}, 2)) == {frozenset({(0, 0), (1, 0)})}
