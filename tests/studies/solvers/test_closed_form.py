"""Tests of the paper's closed form on batches of draws."""

from __future__ import annotations

import numpy as np

from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import axis_shift_state
from basecal.studies.draws import draw, draw_cell
from basecal.studies.solvers.closed_form import solve
from study_example import study

HOLD = "layout: shifts, distance_m: 3, pixel_px: 0.0"


def test_closed_form_matches_the_estimator() -> None:
    """Without noise the result is that of the method for the cell's own recording, to 1e-9."""
    settings = study(hold=HOLD).points[0].settings
    cell = draw_cell(settings, 0, 0, None)
    found = solve(draw(cell, settings, (0, 0, 0), 2))
    problem, _ = build_problem(cell.simulated.cell, cell.simulated.recording)
    own = axis_shift_state(problem, cell.simulated.cell).transforms["eye_base_from_hand_base"]
    np.testing.assert_allclose(found.transform[0].matrix, own.matrix, atol=1e-9)
    assert found.covariance is None
    assert found.solved.all()
