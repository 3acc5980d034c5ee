"""Tests of refining starts of pairs in a batch, with the best of each independent of the others."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.estimation.start.pair_views import pair_views
from basecal.estimation.start.refinement import Refinement, pair_problem, refine_jointly
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def make_request(seed, views=100, starts=(0.3, 0.05), searched=False, known="", scenario=None):
    """A request with a pair's views and starts this far off the truth [m, rad], and the true X, Y and Z."""
    made = simulate(scenario or Scenario(samples=10), seed)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    pair = pair_views(group, made.cameras["wrist"], views, 12)
    names = dict(zip("xyz", (group.eye.mount, group.hand.base, group.hand.mount), strict=True))
    truth = tuple(made.truth[names[k]] for k in "xyz")
    rng = np.random.default_rng(seed)
    at = dict(zip("xyz", truth, strict=True))
    away = [
        tuple(at[k] if k in known else at[k] @ SE3.exp(off * rng.uniform(-1, 1, 6)) for k in "xyz") for off in starts
    ]
    loop = pair.loop(*(at[k] if k in known else None for k in "xyz"), np.zeros(len(pair.group), dtype=int))
    return Refinement(pair, loop, away, pair.candidates is None, searched), truth


def distance(found, truth):
    return max(
        np.abs((a.inverse() @ b).log()[: 3 if k == 2 else 6]).max()
        for k, (a, b) in enumerate(zip(found, truth, strict=True))
    )


def test_best_start_is_refined():
    """A start near the truth reaches it to 5 mm and mrad, though the other starts are hopeless."""
    asked, truth = make_request(1, starts=(3.0, 0.05, 3.0))
    (found,) = refine_jointly([asked])
    assert distance(found, truth) < 5e-3


def test_refinements_in_a_batch_are_independent():
    """Pairs with different numbers of views, and one of another structure, end where each ends alone."""
    wishes = [make_request(1)[0], make_request(2, views=6)[0], make_request(3, known="x")[0], make_request(4)[0]]
    together = refine_jointly(wishes)
    for one, found in zip(wishes, together, strict=True):
        (alone,) = refine_jointly([one])
        for a, b in zip(found, alone, strict=True):
            np.testing.assert_allclose((a.inverse() @ b).log(), 0.0, atol=1e-7)


def test_rotations_are_searched_on_request():
    """From hopeless starts alone the truth is found with a search, and not without one."""
    (without,) = refine_jointly([make_request(5, starts=(3.0,))[0]])
    asked, truth = make_request(5, starts=(3.0,), searched=True)
    (found,) = refine_jointly([asked])
    assert distance(found, truth) < 5e-3 < distance(without, truth)


def test_known_transforms_are_unchanged():
    """A known mount equals that of the start after the refinement."""
    asked, truth = make_request(6, known="x")
    (found,) = refine_jointly([asked])
    np.testing.assert_array_equal(found[0].matrix, truth[0].matrix)
    assert distance(found, truth) < 5e-3


@pytest.mark.parametrize(("known", "is_point", "columns"), [
    ("", False, {"x": slice(0, 6), "y": slice(6, 12), "z": slice(12, 18)}),
    ("", True, {"x": slice(0, 6), "y": slice(6, 12), "z": slice(12, 15)}),
    ("y", True, {"x": slice(0, 6), "z": slice(6, 9)}),
])  # fmt: skip
def test_pair_problem_has_three_unknowns(known, is_point, columns):
    """The mount of a single point has three columns, stops have no noise, and names are those of the loop."""
    asked, _ = make_request(7, known=known, scenario=Scenario(samples=5, robot_noise=(1e-3, 1e-3)))
    problem = pair_problem(asked.views, asked.loop, is_point)
    assert problem.columns == columns
    (group,) = problem.groups
    assert (group.eye.mount, group.eye.base, group.hand.base, group.hand.mount) == ("x", None, "y", "z")
    assert set(group.eye.stop.tolist()) | set(group.hand.stop.tolist()) == {-1}
    assert len(problem.stops) == 0


def test_structures_of_pairs_are_compared():
    """Structures differ by camera, points of the target, unknowns, point mounts, and searches."""
    same, _ = make_request(1)
    assert same.structure == make_request(2, views=6)[0].structure
    others = [
        make_request(1, known="x")[0],
        make_request(1, searched=True)[0],
        make_request(1, scenario=Scenario(samples=10, target="points"))[0],
    ]
    assert len({same.structure, *(other.structure for other in others)}) == 4


def test_every_view_of_a_pair_counts():
    """The end is the optimum of the pair alone, with the first and last view and all between."""
    asked, truth = make_request(8, views=4, starts=(0.02,))
    (found,) = refine_jointly([asked])
    state = State(dict(zip("xyz", truth, strict=True)), {}, np.zeros((0, 6)))
    best = bundle_adjust(pair_problem(asked.views, asked.loop, False), state, 1).state
    for name, at in zip("xyz", found, strict=True):
        np.testing.assert_allclose((best.transforms[name].inverse() @ at).log(), 0.0, atol=1e-5)


@pytest.mark.parametrize("seed", [21, 57, 141])
def test_small_distant_board_uses_both_poses(seed):
    """Sixteen points within 90 mm, 1.5 to 2.5 m away, have two similar poses. The optimum has the cost of the noise."""
    seen = {"board": chessboard_target((4, 4), 0.03), "distance_m": (1.5, 2.5), "pixel_px": 1.5}
    scenario = Scenario(9, "chessboard", spread_rad=0.4, robot_noise=(1e-4, 2e-4), **seen)
    made = simulate(scenario, seed)
    solution = solve(made.cell, made.recording)
    assert solution.cost < 1.3 * solution.dof
