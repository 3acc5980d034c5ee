"""Tests of `fit_details`."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import fit_details, view_poses
from basecal.accuracy.residuals.evaluation import evaluate_recording
from basecal.simulation import Scenario, simulate


@pytest.mark.journey
def test_details_have_same_samples():
    """Points, poses and errors of a fit cover exactly the recorded samples."""
    made = simulate(Scenario(samples=10), 1)
    details = fit_details(made.cell, made.recording, calibrate(made.cell, made.recording))
    (points,), (views,) = details.points, details.views
    assert set(points.sample.tolist()) == set(views.sample.tolist()) == set(range(10))
    assert [error.transform for error in details.errors] == made.cell.requested_transforms
    assert np.all(points.used)


@pytest.mark.journey
def test_view_poses_equal_recorded_poses():
    """View poses of a cell with exact observed poses equal the recorded ones."""
    made = simulate(Scenario(samples=10, target="pose", pose_noise=(0.0, 0.0)), 1)
    calibration = calibrate(made.cell, made.recording)
    (views,) = view_poses(evaluate_recording(made.cell, made.recording, calibration))
    for sample, pose in zip(views.sample.tolist(), views.camera_from_target, strict=True):
        (seen,) = made.recording.samples[sample].observations
        np.testing.assert_allclose(pose.matrix, seen.camera_from_target.matrix, atol=1e-8)
