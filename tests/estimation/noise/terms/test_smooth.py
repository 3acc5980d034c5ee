"""Smooth errors by few modes are those of the kernel."""

from __future__ import annotations

import numpy as np

from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.noise.terms.smooth import LENGTH_M, modes
from basecal.estimation.problem.build import build_problem
from basecal.geometry.rotation import rotation_log
from basecal.simulation import Scenario, simulate


def test_modes_make_the_kernel():
    """Products of modes are exp(-d^2 / 2 l^2) of the stops' distances d, to what the modes left out explain, 8 %."""
    s = simulate(Scenario(samples=30), 1)
    problem, _ = build_problem(s.cell, s.recording)
    found, (poses, _) = modes(problem, "hand"), stands(problem, "hand")
    turn = rotation_log(np.swapaxes(poses.rotation, -1, -2)[:, None] @ poses.rotation[None])
    shift = poses.translation[:, None] - poses.translation[None]
    squared = np.sum(shift**2, -1) + np.sum(turn**2, -1)
    np.testing.assert_allclose(found @ found.T, np.exp(-0.5 * squared / LENGTH_M**2), atol=0.08)
