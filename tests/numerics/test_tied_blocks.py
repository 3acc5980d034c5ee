"""Nodes tied by pairs."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.tied_blocks import components, tied_blocks

NOTHING = np.zeros((0, 2), dtype=np.int64)


def test_nodes_without_pairs_stand_alone():
    """Each in a block of its own; of none there are none."""
    of = tied_blocks(NOTHING, 3, 4)
    assert (of.block.tolist(), of.place.tolist(), of.hubs) == ([0, 1, 2], [0, 0, 0], [])
    assert tied_blocks(NOTHING, 0, 4).block.tolist() == []


def test_what_pairs_lead_to_is_one_block():
    """Whatever way they lead, in the order of the nodes."""
    of = tied_blocks(np.array([[5, 0], [0, 3], [5, 0], [1, 4]]), 6, 3)
    assert of.hubs == []
    assert of.block[[0, 3, 5]].tolist() == [of.block[0]] * 3
    assert of.place.tolist() == [0, 0, 0, 1, 1, 2]
    assert len({of.block[0], of.block[1], of.block[2]}) == 3


def test_a_long_chain_in_any_order_is_one_block(rng):
    """Two chains whose nodes are numbered at random."""
    node = rng.permutation(600)
    of = tied_blocks(np.stack([np.delete(node[:-1], 299), np.delete(node[1:], 299)], axis=1), 600, 300)
    assert of.hubs == []
    assert [set(of.block[half].tolist()) for half in (node[:300], node[300:])] in ([{0}, {1}], [{1}, {0}])


@pytest.mark.parametrize("most", [1, 2, 4])
def test_hubs_are_taken_out(most):
    """A star and a long chain fall apart into blocks that are small enough; what is small anyhow keeps its nodes."""
    star = [[0, k] for k in range(1, 9)]
    chain = [[k, k + 1] for k in range(10, 19)]
    of = tied_blocks(np.array([*star, *chain, [20, 21]]), 22, most)
    assert 0 in of.hubs
    assert np.flatnonzero(of.block == -1).tolist() == of.hubs == np.flatnonzero(of.place == -1).tolist()
    assert np.bincount(of.block[of.block >= 0]).max() <= most
    assert np.isin([20, 21], of.hubs).sum() == (most == 1)
    inside = np.array([pair for pair in chain if not set(pair) & set(of.hubs)], dtype=np.int64).reshape(-1, 2)
    assert np.array_equal(of.block[inside[:, 0]], of.block[inside[:, 1]])


def test_hubs_are_those_of_most_pairs_and_no_more():
    """Two stars that share a leaf fall apart without their middles; a pair told twice, or turned round, counts once."""
    pairs = [[0, k] for k in range(2, 7)] + [[k, 1] for k in range(6, 10)] + [[2, 3]] * 9 + [[3, 2]] * 9
    of = tied_blocks(np.array(pairs), 10, 2)
    assert of.hubs == [0, 1]
    assert of.block[2] == of.block[3]
    assert len(set(of.block[2:].tolist())) == 7
    assert of.place.tolist() == [-1, -1, 0, 1, 0, 0, 0, 0, 0, 0]
    assert tied_blocks(np.array([[0, 1], [1, 2]]), 3, 3).hubs == []
    assert tied_blocks(np.array([[0, 1], [1, 2]]), 3, 2).hubs == [1]


def test_components_are_named_by_their_lowest_node():
    """However long the way is, and in whatever order its pairs are."""
    assert components(NOTHING, 3).tolist() == [0, 1, 2]
    assert components(np.array([[4, 3], [3, 1], [5, 2]]), 6).tolist() == [0, 1, 2, 1, 1, 2]
    chain = np.stack([np.arange(1, 50), np.arange(49)], axis=1)[::-1]
    assert components(chain, 50).tolist() == [0] * 50
    assert components(NOTHING, 0).tolist() == []


def test_known_hubs_are_in_no_block():
    """What they tie falls apart."""
    of = tied_blocks(np.array([[0, 1], [1, 2], [3, 4]]), 5, 5, [1])
    assert of.hubs == [1]
    assert of.block.tolist() == [0, -1, 1, 2, 2]
    assert of.place.tolist() == [0, -1, 0, 0, 1]
