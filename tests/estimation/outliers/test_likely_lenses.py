"""Tests of stated lenses whose errors are estimated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.outliers.likely_lenses import with_likely_lenses
from basecal.estimation.outliers.robust_solve import solve_robustly
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.stated_lens import usual_sigmas
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=20, layout="eye_in_hand"), 3)
SETTINGS = Settings(robot_noise="stated")


def solve_with_lens_error(off_px: float, exact: bool = False):
    """The cell with this error of the stated principal point, and its solution with the usual lens errors."""
    wrist = MADE.cell.cameras["wrist"]
    camera = wrist.intrinsics.camera
    stated = camera.with_parameters(camera.parameters + off_px * (np.arange(9) == 2))
    lens = replace(wrist.intrinsics, camera=stated, exact=exact)
    cell = replace(MADE.cell, cameras={"wrist": replace(wrist, intrinsics=lens)})
    problem, _ = build_problem(cell, MADE.recording)
    return cell, solve_robustly(problem, cell, SETTINGS, solve_problem(problem, cell, SETTINGS))


@pytest.mark.journey
@pytest.mark.parametrize(("off_px", "exact"), [(0.0, False), (1.0, False), (25.0, True)])
def test_usual_lens_errors_are_kept(off_px, exact):
    """If the lens error is usual, or the lens is stated as exact, the solution is unchanged."""
    cell, found = solve_with_lens_error(off_px, exact)
    assert with_likely_lenses(found, cell, SETTINGS).solution.state is found.solution.state


def test_lens_far_off_is_estimated():
    """An error of 25 px, twenty usual sigmas, biases the solution by several of its own sigmas.

    The estimate removes the bias.
    """
    cell, found = solve_with_lens_error(25.0)
    after = with_likely_lenses(found, cell, SETTINGS).solution
    true, sigma = MADE.cameras["wrist"].parameters, np.sqrt(np.diag(after.lens_covariance("wrist")))
    assert np.abs((found.solution.state.cameras["wrist"].parameters - true) / sigma)[2] > 4
    assert np.abs((after.state.cameras["wrist"].parameters - true) / sigma).max() < 3
    assert after.problem.lenses["wrist"].sigma[2] > 8 * usual_sigmas(cell.cameras["wrist"].intrinsics.camera)[2]
