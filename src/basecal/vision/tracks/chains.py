"""Tracks from matches of many pairs of images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry import IntArray
from basecal.numerics.tied_blocks import components
from basecal.vision.tracks.matching import Matches


class Chains(NamedTuple):
    """Features of tracks: index of view, of feature and of track, (n,) each."""

    view: IntArray
    feature: IntArray
    track: IntArray


def chain_matches(counts: Sequence[int], matches: Mapping[tuple[int, int], Matches], min_images: int) -> Chains:
    """Chain matches into tracks; images in which a track has several features are left out of it.

    Args:
        counts: Number of features of each image.
        matches: Matches by the indices of two images.
        min_images: Smallest number of images of a track.
    """
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pairs = [(first[i] + each.first, first[j] + each.second) for (i, j), each in matches.items()]
    none = np.zeros(0, dtype=np.int64)
    first_nodes, second_nodes = (np.concatenate([none, *(pair[k] for pair in pairs)]) for k in (0, 1))
    track = components(np.column_stack([first_nodes, second_nodes]), int(first[-1]))
    view = np.repeat(np.arange(len(counts)), counts)
    _, which, times = np.unique(track * len(counts) + view, return_inverse=True, return_counts=True)
    is_single = times[which] == 1
    enough = np.bincount(track[is_single], minlength=len(track) + 1)[track] >= min_images
    kept = np.flatnonzero(is_single & enough)
    numbered = np.unique(track[kept], return_inverse=True)[1]
    return Chains(view[kept], kept - first[view[kept]], numbered.astype(np.int64))


def longest_chains(chains: Chains, max_count: int) -> Chains:
    """The `max_count` tracks in the largest numbers of images."""
    images = np.bincount(chains.track)
    chosen = np.sort(np.argsort(-images, kind="stable")[:max_count])
    kept = np.isin(chains.track, chosen)
    return Chains(chains.view[kept], chains.feature[kept], np.searchsorted(chosen, chains.track[kept]))
