"""Details of a fit belong together."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import fit_details
from basecal.simulation import Scenario, simulate


def test_details_are_of_the_same_views():
    """Points, poses and errors of two targets in a row are of the samples that were recorded."""
    made = simulate(Scenario(samples=10), 1)
    details = fit_details(made.cell, made.recording, calibrate(made.cell, made.recording))
    (points,), (views,) = details.points, details.views
    assert set(points.sample.tolist()) == set(views.sample.tolist()) == set(range(10))
    assert [error.transform for error in details.errors] == made.cell.requested_transforms
    assert np.all(points.used)
