"""Tests of grouping pairs with equal structure into batches, whatever their names and numbers of views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.least_squares import equal_pairs as module
from basecal.estimation.least_squares.equal_pairs import group_pairs
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.simulation import Scenario, simulate


def make_problem(scenario: Scenario):
    made = simulate(scenario, 1)
    return build_problem(made.cell, made.recording)[0]


def test_ring_is_one_batch_except_reference_pairs() -> None:
    """Every pair is in one batch, once. Pairs of the reference have one base less on either side."""
    ring = make_problem(Scenario(layout="ring", robots=5, samples=53, robot_noise=(1e-4, 1e-4)))
    batches = group_pairs(ring)
    assert sorted(number for of in batches for number in of.groups) == list(range(10))
    assert sorted(len(of.groups) for of in batches) == [2, 2, 6]
    for of in batches:
        assert of.weight.sum() == sum(len(ring.groups[number]) for number in of.groups)
        for names, columns in zip(of.names, of.columns, strict=True):
            expected = [
                np.arange(ring.columns[n].start, ring.columns[n].stop) for n in names.values() if n in ring.columns
            ]
            np.testing.assert_array_equal(columns, np.concatenate(expected))


def test_different_noise_needs_another_batch() -> None:
    """Stops of one batch have the same sigmas."""
    ring = make_problem(Scenario(layout="ring", robots=5, samples=50, robot_noise=(1e-4, 1e-4)))
    noisier = np.array(ring.stops.robot) == "r3"
    sigma = np.where(noisier[:, None], 2 * ring.stops.sigma, ring.stops.sigma)
    batches = group_pairs(replace(ring, stops=replace(ring.stops, sigma=sigma)))
    assert len(batches) > 3
    for of in batches:
        assert all((sigma[stops] == of.problem.stops.sigma).all() for stops in of.stops)


def test_many_views_are_split_into_parts(monkeypatch) -> None:
    """A part has a limited number of views, or one pair, and no pair is lost."""
    ring = make_problem(Scenario(layout="ring", robots=5, samples=50, robot_noise=(1e-4, 1e-4)))
    monkeypatch.setattr(module, "MOST_VIEWS", 12)
    batches = group_pairs(ring)
    assert sorted(number for of in batches for number in of.groups) == list(range(10))
    assert all(of.rows.size <= 12 or len(of.groups) == 1 for of in batches)
    assert max(len(of.groups) for of in batches) == 2


def test_batch_states_equal_the_cells(monkeypatch) -> None:
    """In batches of several pairs or of one, each transform is that of the pair's own name."""
    made = simulate(Scenario(layout="ring", robots=5, samples=50, robot_noise=(1e-4, 1e-4)), 1)
    ring = build_problem(made.cell, made.recording)[0]
    state = State(made.truth, made.cameras, np.zeros((len(ring.stops), 6)))
    monkeypatch.setattr(module, "MOST_VIEWS", 4)
    batches = group_pairs(ring)
    assert min(len(of.groups) for of in batches) == 1
    for of in batches:
        own = of.state(state)
        for k, names in enumerate(of.names):
            for field, name in names.items():
                np.testing.assert_array_equal(own.transforms[field][k].matrix, made.truth[name].matrix)


def test_view_weights_follow_each_pair(monkeypatch) -> None:
    """Weights are none if all views count once, and repeated views have weight zero."""
    ring = make_problem(Scenario(layout="ring", robots=5, samples=53, robot_noise=(1e-4, 1e-4)))
    monkeypatch.setattr(module, "linearise", lambda problem, own, weights: weights)
    for of in group_pairs(ring):
        once = bool(of.weight.all())
        assert (of.linearise(None, None) is None) == once
        assert (of.linearise(None, [np.ones(len(g)) for g in ring.groups]) is None) == once
        for scale in (0.5, 2.0):
            (found,) = of.linearise(None, [scale + np.arange(len(g)) for g in ring.groups])
            np.testing.assert_array_equal(found, of.weight * (scale + of.rows))
            (found,) = of.linearise(None, [np.full(len(g), scale) for g in ring.groups])
            np.testing.assert_array_equal(found, scale * of.weight)


def test_different_unknowns_need_another_batch() -> None:
    """A pair whose target mount is known has fewer columns. An LED's mount has only a position."""
    ring = make_problem(Scenario(layout="ring", robots=5, samples=50))
    mount = ring.groups[4].hand.mount
    known = replace(ring, columns={name: where for name, where in ring.columns.items() if name != mount})
    apart = {of.groups: of.columns.shape[1] for of in group_pairs(known)}
    assert len(apart) > len(group_pairs(ring))
    for groups, width in apart.items():
        for number in groups:
            assert width == 6 * sum(name in known.columns for name in ring.groups[number].frames)
    assert [of.problem.point_mounts for of in group_pairs(ring)] == [frozenset()] * len(group_pairs(ring))
    (light,) = group_pairs(make_problem(Scenario(samples=4, target="led")))
    assert light.problem.point_mounts == {"hand_mount"}
