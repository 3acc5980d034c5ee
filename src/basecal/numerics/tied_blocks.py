"""Nodes that pairs tie together, in small blocks: those that tie too many are taken out as hubs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry import IntArray


class TiedBlocks(NamedTuple):
    """Nodes in blocks that no pair leads out of.

    Attributes:
        block: (n,) the number of each node's block; -1 of a hub.
        place: (n,) its place there, in the order of the nodes; -1 of a hub.
        hubs: Nodes in no block, rising.
    """

    block: IntArray
    place: IntArray
    hubs: list[int]


def tied_blocks(pairs: IntArray, count: int, block_size: int, known_hubs: Sequence[int] = ()) -> TiedBlocks:
    """Blocks of at most so many nodes.

    Args:
        pairs: (p, 2) nodes that stand in one block, or of which one is a hub.
        count: How many nodes there are.
        block_size: Of a block.
        known_hubs: Nodes that are hubs whatever they tie.
    """
    pairs = pairs[~np.isin(pairs, known_hubs).any(axis=1)]
    label = components(pairs, count)
    found = _separator_nodes(pairs[np.bincount(label)[label[pairs[:, 0]]] > block_size], block_size)
    hubs = sorted({*map(int, known_hubs), *found})
    if hubs:
        label = components(pairs[~np.isin(pairs, hubs).any(axis=1)], count)
    others = np.setdiff1d(np.arange(count), hubs)
    block, place = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    _, block[others] = np.unique(label[others], return_inverse=True)
    order = others[np.argsort(block[others], kind="stable")]
    place[order] = np.arange(len(order)) - np.searchsorted(block[order], block[order])
    return TiedBlocks(block, place, hubs)


def components(pairs: IntArray, count: int) -> IntArray:
    """The lowest node that pairs lead to from each of so many nodes, (count,)."""
    label = np.arange(count)
    previous = label - 1
    while not np.array_equal(label, previous):
        previous, label = label, label.copy()
        ends = previous[pairs]
        np.minimum.at(label, ends, ends.min(axis=1, keepdims=True))
        label = label[label]
    return label


def _separator_nodes(pairs: IntArray, block_size: int) -> list[int]:
    """Nodes without which pairs tie no more than so many others together, rising: those of most pairs first."""
    partners: dict[int, set[int]] = defaultdict(set)
    for a, b in set(map(tuple, pairs.tolist())):
        partners[a].add(b)
        partners[b].add(a)
    hubs: set[int] = set()
    waiting, seen = sorted(partners), set[int]()
    while waiting:
        first = waiting.pop()
        if first in seen:
            continue
        nodes = _connected_nodes(first, partners)
        if len(nodes) <= block_size:
            seen |= nodes
            continue
        hub = max(nodes, key=lambda node: len(partners[node]))
        hubs.add(hub)
        for other in partners.pop(hub):
            partners[other].discard(hub)
        waiting += nodes - {hub}
    return sorted(hubs)


def _connected_nodes(first: int, partners: Mapping[int, set[int]]) -> set[int]:
    """The nodes that pairs tie to one, itself among them."""
    reached, waiting = {first}, [first]
    while waiting:
        fresh = partners[waiting.pop()] - reached
        reached |= fresh
        waiting += fresh
    return reached
