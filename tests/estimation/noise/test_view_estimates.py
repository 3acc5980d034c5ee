"""What a view says by itself is its own estimate; what is left of its points is their scatter."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.noise.view_estimates import view_estimates
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.simulation import Scenario, simulate


def test_a_board_counts_as_its_pose_and_its_points_show_their_scatter():
    """At the truth a view of a board has six freedoms, and its points scatter by the 0.2 px they were drawn with."""
    s = simulate(Scenario(samples=20, state_pixel_noise=False), 1)
    problem, _ = build_problem(s.cell, s.recording)
    found = view_estimates(problem, problem.groups[0], State(s.truth, s.cameras, np.zeros((0, 6))))["pixel_px"]
    assert found.count == 6 * 20
    assert np.sqrt(found.white / found.white_count) == pytest.approx(0.2, rel=0.1)
    assert found.cost.sum() / found.count == pytest.approx(0.04, rel=0.6)
