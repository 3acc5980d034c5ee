"""Bases in a graph whose loops close."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start.base_graph import Relation, placed_by_all
from basecal.geometry import SE3


@pytest.fixture
def bases(rng):
    """Six of them, the reference without a name first."""
    return {None: SE3.identity(), **{f"b{k}": SE3.exp(rng.uniform(-1, 1, 6)) for k in range(5)}}


def ring(bases, errors):
    names = list(bases)
    pairs = [(names[k], names[(k + step) % 6]) for k in range(6) for step in (1, 2)]
    return [Relation(a, b, bases[a].inverse() @ bases[b] @ SE3.exp(e)) for (a, b), e in zip(pairs, errors, strict=True)]


def off(found, bases):
    return np.stack([(pose.inverse() @ bases[name]).log() for name, pose in found.items()])


def test_relations_without_error_place_bases(bases, rng) -> None:
    """From far away."""
    told = ring(bases, np.zeros((12, 6)))
    start = {name: pose @ SE3.exp(0.2 * rng.standard_normal(6)) for name, pose in bases.items() if name}
    assert np.abs(off(placed_by_all(start, told), bases)).max() < 1e-6


def test_loops_halve_errors(bases, rng) -> None:
    """What closes loops is used: errors are smaller than along a chain."""
    errors = 1e-2 * rng.standard_normal((12, 6))
    told = ring(bases, errors)
    chain, at = {}, SE3.identity()
    for of in told[:10:2]:
        at = at @ of.eye_base_from_hand_base
        chain[of.hand_base] = at
    found = placed_by_all(chain, told)
    assert np.sqrt(np.mean(off(found, bases) ** 2)) < 0.7 * np.sqrt(np.mean(off(chain, bases) ** 2))


def test_a_base_that_nothing_names_stays(bases) -> None:
    """As it is."""
    told = ring(bases, np.zeros((12, 6)))
    alone = SE3.exp(np.arange(6) * 0.1)
    found = placed_by_all({**{k: v for k, v in bases.items() if k}, "alone": alone}, told)
    np.testing.assert_array_equal(found["alone"].matrix, alone.matrix)


def test_bases_are_those_of_least_squares(bases, rng) -> None:
    """Relations that contradict one another, the reference on either side: no step of a base lessens what is left."""
    told = ring(bases, 0.05 * rng.standard_normal((12, 6)))
    told[0] = Relation(told[0].hand_base, told[0].eye_base, told[0].eye_base_from_hand_base.inverse())
    eye_from_hand = SE3.stack([of.eye_base_from_hand_base for of in told])
    found = placed_by_all({name: bases[name] @ SE3.exp(np.full(6, 0.1)) for name in bases if name}, told)

    def misfit(moved):
        at = {None: SE3.identity(), **found, **moved}
        eye, hand = (SE3.stack([at[name] for name in side]) for side in zip(*pairs, strict=True))
        return float(np.sum((eye_from_hand.inverse() @ eye.inverse() @ hand).log() ** 2))

    pairs = [(of.eye_base, of.hand_base) for of in told]
    least = misfit({})
    assert least > 1e-3
    for name, pose in found.items():
        for step in 1e-4 * np.eye(6):
            there, back = (misfit({name: pose @ SE3.exp(sign * step)}) for sign in (1, -1))
            assert there > least < back
            assert abs(there - back) < 1e-6 * least
