"""Partition the nodes of a graph into small blocks; nodes that connect too many others are removed as hubs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry import IntArray


class TiedBlocks(NamedTuple):
    """Partition of nodes into blocks without pairs between them.

    Attributes:
        block: (n,) block number of each node; -1 for a hub.
        place: (n,) position of each node in its block, in the order of the nodes; -1 for a hub.
        hubs: Nodes in no block, increasing.
    """

    block: IntArray
    place: IntArray
    hubs: list[int]


def tied_blocks(pairs: IntArray, count: int, block_size: int, known_hubs: Sequence[int] = ()) -> TiedBlocks:
    """Partition nodes into blocks of at most `block_size` nodes.

    Args:
        pairs: (p, 2) pairs of connected nodes, which are in one block unless one of them is a hub.
        count: Number of nodes.
        block_size: Most nodes of a block.
        known_hubs: Nodes that are hubs in any case.
    """
    pairs = pairs[~np.isin(pairs, known_hubs).any(axis=1)]
    label = components(pairs, count)
    separators = _separator_nodes(pairs[np.bincount(label)[label[pairs[:, 0]]] > block_size], block_size)
    hubs = sorted({*map(int, known_hubs), *separators})
    if hubs:
        label = components(pairs[~np.isin(pairs, hubs).any(axis=1)], count)
    others = np.setdiff1d(np.arange(count), hubs)
    block, place = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    _, block[others] = np.unique(label[others], return_inverse=True)
    order = others[np.argsort(block[others], kind="stable")]
    place[order] = np.arange(len(order)) - np.searchsorted(block[order], block[order])
    return TiedBlocks(block, place, hubs)


def components(pairs: IntArray, count: int) -> IntArray:
    """Lowest node of the connected component of each node, (count,)."""
    label = np.arange(count)
    previous = label - 1
    while not np.array_equal(label, previous):
        previous, label = label, label.copy()
        ends = previous[pairs]
        np.minimum.at(label, ends, ends.min(axis=1, keepdims=True))
        label = label[label]
    return label


def _separator_nodes(pairs: IntArray, block_size: int) -> list[int]:
    """Nodes whose removal leaves components of at most `block_size` nodes, increasing.

    In each larger component, the node with the most neighbours is removed first.
    """
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
    """Nodes of the connected component of a node, including the node."""
    reached, waiting = {first}, [first]
    while waiting:
        fresh = partners[waiting.pop()] - reached
        reached |= fresh
        waiting += fresh
    return reached
