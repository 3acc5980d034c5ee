"""What a view says by itself is its own estimate; what is left of its points is their scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.real_recordings import example

from basecal.estimation.noise.target_shape import points_of, shape_of
from basecal.estimation.noise.view_estimates import view_estimates
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum
from basecal.simulation import Scenario, simulate


def test_a_board_counts_as_its_pose_and_its_points_show_their_scatter():
    """At the truth a view of a board has six freedoms, and its points scatter by the 0.2 px they were drawn with."""
    s = simulate(Scenario(samples=20, state_pixel_noise=False), 1)
    problem, _ = build_problem(s.cell, s.recording)
    found = view_estimates(problem, problem.groups[0], State(s.truth, s.cameras, np.zeros((0, 6))))["pixel_px"]
    assert found.count == pytest.approx(6 * 20, rel=1e-6)
    assert np.sqrt(found.white / found.white_count) == pytest.approx(0.2, rel=0.1)
    assert found.cost.sum() / found.count == pytest.approx(0.04, rel=0.6)


def test_freedoms_of_views_with_a_lens_follow_the_state_smoothly():
    """A fortieth of a distortion term moves them by less than a tenth of one, where ranks hop by whole ones."""
    cell, recording = example("ur5e_dual")
    found = solve(cell, recording)
    (group,) = found.problem.groups
    (lens,) = found.state.cameras.values()

    def freedoms(second_term: float) -> tuple[float, int]:
        changed = lens.with_parameters(lens.parameters * np.where(np.arange(9) == 5, second_term, 1.0))
        state = replace(found.state, cameras={group.camera: changed})
        of = view_estimates(found.problem, group, state, shape_of(points_of(group)))["pixel_px"]
        return of.count, int(spectrum(of.information, VIEW_ROUNDING).rank.sum())

    counts, ranks = np.array([freedoms(times) for times in np.arange(0.4, 1.6, 0.025)]).T
    assert np.abs(np.diff(ranks)).max() >= 1
    assert np.abs(np.diff(counts)).max() < 0.1
