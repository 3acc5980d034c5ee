"""Tests of the UR5e's chain against the manufacturer's data."""

from __future__ import annotations

import numpy as np

from basecal.simulation.running.ur5e import ur5e

# Universal Robots' table of Denavit-Hartenberg parameters: a [m], d [m], alpha [rad].
A, D = (0, -0.425, -0.3922, 0, 0, 0), (0.1625, 0, 0, 0.1333, 0.0997, 0.0996)
ALPHA = (np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0)


# Links: mass [kg], and its centre in the frame of these parameters [m].
MASSES = (3.761, 8.058, 2.846, 1.37, 1.3, 0.365)
CENTRES = (
    (0, -0.02561, 0.00193), (0.2125, 0, 0.11336), (0.15, 0, 0.0265),
    (0, -0.0018, 0.01634), (0, 0.0018, 0.01634), (0, 0, -0.001159),
)  # fmt: skip


def frames_by_denavit_hartenberg(joints):
    """Frames of the links, (6, 4, 4)."""
    frames = [np.eye(4)]
    for q, a, d, alpha in zip(joints, A, D, ALPHA, strict=True):
        c, s, ca, sa = np.cos(q), np.sin(q), np.cos(alpha), np.sin(alpha)
        link = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        frames.append(frames[-1] @ link)
    return np.array(frames[1:])


def test_forward_kinematics_match_published_parameters():
    """The flange agrees with the published Denavit-Hartenberg parameters to 1e-12, at random joints."""
    for joints in np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6)):
        np.testing.assert_allclose(ur5e().forward(joints).matrix, frames_by_denavit_hartenberg(joints)[-1], atol=1e-12)


def test_centres_of_mass_match_published_ones():
    """The position of each link's mass is the published one, at random joints."""
    masses = ur5e().masses
    np.testing.assert_array_equal(masses.kg, MASSES)
    for joints in np.random.default_rng(0).uniform(-np.pi, np.pi, (5, 6)):
        published = (frames_by_denavit_hartenberg(joints) @ np.c_[CENTRES, np.ones(6)][..., None])[:, :3, 0]
        np.testing.assert_allclose((ur5e().joint_frames(joints) @ masses.centres), published, atol=1e-12)


def test_joint_limits_are_one_turn_except_elbow():
    """Joints rotate by one turn in both directions, the elbow by half a turn."""
    chain = ur5e()
    np.testing.assert_allclose(chain.upper, np.radians([360, 360, 180, 360, 360, 360]))
    np.testing.assert_allclose(chain.lower, -chain.upper)
