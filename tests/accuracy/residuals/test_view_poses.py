"""Poses of views against the truth."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals.evaluation import evaluate_recording
from basecal.accuracy.residuals.view_poses import view_poses
from basecal.simulation import Scenario, simulate


def test_poses_are_those_that_views_show():
    """Of a cell seen as exact poses, they are what was recorded."""
    made = simulate(Scenario(samples=10, target="pose", pose_noise=(0.0, 0.0)), 1)
    calibration = calibrate(made.cell, made.recording)
    (views,) = view_poses(evaluate_recording(made.cell, made.recording, calibration))
    for sample, pose in zip(views.sample.tolist(), views.camera_from_target, strict=True):
        (seen,) = made.recording.samples[sample].observations
        np.testing.assert_allclose(pose.matrix, seen.camera_from_target.matrix, atol=1e-8)
