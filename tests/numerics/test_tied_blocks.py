"""Tests of grouping nodes connected by pairs into blocks and hubs."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.tied_blocks import components, tied_blocks

NOTHING = np.zeros((0, 2), dtype=np.int64)


def test_nodes_without_pairs_have_their_own_blocks():
    """Each node is in a block of its own, and no nodes have no blocks."""
    of = tied_blocks(NOTHING, 3, 4)
    assert (of.block.tolist(), of.place.tolist(), of.hubs) == ([0, 1, 2], [0, 0, 0], [])
    assert tied_blocks(NOTHING, 0, 4).block.tolist() == []


def test_connected_nodes_form_one_block():
    """Pairs connect nodes in either direction, and places follow the order of the nodes."""
    of = tied_blocks(np.array([[5, 0], [0, 3], [5, 0], [1, 4]]), 6, 3)
    assert of.hubs == []
    assert of.block[[0, 3, 5]].tolist() == [of.block[0]] * 3
    assert of.place.tolist() == [0, 0, 0, 1, 1, 2]
    assert len({of.block[0], of.block[1], of.block[2]}) == 3


def test_long_chain_is_one_block_in_any_order(rng):
    """Two chains with randomly numbered nodes are two blocks."""
    node = rng.permutation(600)
    of = tied_blocks(np.stack([np.delete(node[:-1], 299), np.delete(node[1:], 299)], axis=1), 600, 300)
    assert of.hubs == []
    assert [set(of.block[half].tolist()) for half in (node[:300], node[300:])] in ([{0}, {1}], [{1}, {0}])


@pytest.mark.parametrize("most", [1, 2, 4])
def test_hubs_split_large_blocks(most):
    """Hubs split a star and a long chain into blocks below the limit, and small blocks keep their nodes."""
    star = [[0, k] for k in range(1, 9)]
    chain = [[k, k + 1] for k in range(10, 19)]
    of = tied_blocks(np.array([*star, *chain, [20, 21]]), 22, most)
    assert 0 in of.hubs
    assert np.flatnonzero(of.block == -1).tolist() == of.hubs == np.flatnonzero(of.place == -1).tolist()
    assert np.bincount(of.block[of.block >= 0]).max() <= most
    assert np.isin([20, 21], of.hubs).sum() == (most == 1)
    inside = np.array([pair for pair in chain if not set(pair) & set(of.hubs)], dtype=np.int64).reshape(-1, 2)
    assert np.array_equal(of.block[inside[:, 0]], of.block[inside[:, 1]])


def test_hubs_are_the_fewest_nodes_with_most_pairs():
    """Two stars that share a leaf are split by their centres. Repeated or reversed pairs count once."""
    pairs = [[0, k] for k in range(2, 7)] + [[k, 1] for k in range(6, 10)] + [[2, 3]] * 9 + [[3, 2]] * 9
    of = tied_blocks(np.array(pairs), 10, 2)
    assert of.hubs == [0, 1]
    assert of.block[2] == of.block[3]
    assert len(set(of.block[2:].tolist())) == 7
    assert of.place.tolist() == [-1, -1, 0, 1, 0, 0, 0, 0, 0, 0]
    assert tied_blocks(np.array([[0, 1], [1, 2]]), 3, 3).hubs == []
    assert tied_blocks(np.array([[0, 1], [1, 2]]), 3, 2).hubs == [1]


def test_components_are_labelled_by_their_lowest_node():
    """Labels are correct for paths of any length and pairs in any order."""
    assert components(NOTHING, 3).tolist() == [0, 1, 2]
    assert components(np.array([[4, 3], [3, 1], [5, 2]]), 6).tolist() == [0, 1, 2, 1, 1, 2]
    chain = np.stack([np.arange(1, 50), np.arange(49)], axis=1)[::-1]
    assert components(chain, 50).tolist() == [0] * 50
    assert components(NOTHING, 0).tolist() == []


def test_known_hubs_are_in_no_block():
    """A known hub no longer connects its neighbours."""
    of = tied_blocks(np.array([[0, 1], [1, 2], [3, 4]]), 5, 5, [1])
    assert of.hubs == [1]
    assert of.block.tolist() == [0, -1, 1, 2, 2]
    assert of.place.tolist() == [0, -1, 0, 0, 1]
