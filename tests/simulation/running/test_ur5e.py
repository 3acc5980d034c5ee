"""The UR5e's chain against what its maker publishes."""

from __future__ import annotations

import numpy as np

from basecal.simulation.running.ur5e import ur5e

# Universal Robots' table of Denavit-Hartenberg parameters: a [m], d [m], alpha [rad].
A, D = (0, -0.425, -0.3922, 0, 0, 0), (0.1625, 0, 0, 0.1333, 0.0997, 0.0996)
ALPHA = (np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0)


def by_denavit_hartenberg(joints):
    out = np.eye(4)
    for q, a, d, alpha in zip(joints, A, D, ALPHA, strict=True):
        c, s, ca, sa = np.cos(q), np.sin(q), np.cos(alpha), np.sin(alpha)
        out = out @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    return out


def test_forward_kinematics_are_the_published_ones():
    """The flange is where the published parameters have it, to 1e-12, at joints drawn at random."""
    for joints in np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6)):
        np.testing.assert_allclose(ur5e().forward(joints).matrix, by_denavit_hartenberg(joints), atol=1e-12)
