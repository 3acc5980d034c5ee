"""Starts of planes, edges and hinges."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import BASE, TRUTH, clamp_cell, clamp_lines, held_poses, recorded, surface_cell, surface_lines

from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve
from basecal.estimation.start.first_state import first_state

SHAPES = [
    {"floor": "plane", "wall": "plane", "side": "plane"},
    {"floor": "plane", "mark_a": "point", "mark_b": "point"},
    {"wall": "edge", "side": "edge", "floor": "plane"},
]


@pytest.mark.parametrize("shapes", SHAPES)
def test_bases_by_planes_and_edges(shapes):
    """Exact touches of surfaces that nobody knows the places of end at the true base, from no guess."""
    cell = surface_cell(shapes)
    found = solve(cell, recorded(cell, surface_lines(np.random.default_rng(0), 60, 1e-6, shapes)))
    assert np.abs((found.state.transforms[BASE].inverse() @ TRUTH).log()).max() < 1e-4


def test_both_ends_of_a_hinge_are_parallel():
    """In the first state z of both ends points the same way at every sample, within 0.3 rad."""
    cell = clamp_cell("free")
    lines = clamp_lines(held_poses(np.random.default_rng(0), 20, 0.0, 0.0, is_hinge=True))
    problem, _ = build_problem(cell, recorded(cell, lines))
    state = first_state(problem, cell, thorough=False)
    for group in problem.groups:
        axes = state.camera_from_target(group, problem.stops).rotation[..., 2]
        assert np.all(axes[:, 2] > np.cos(0.3))
