"""Kinematics and masses of the UR5e, as published by the manufacturer.

Source: Universal Robots, "DH parameters for calculations of kinematics and dynamics" (UR5e); masses and centres of
Universal_Robots_ROS2_Description, config/ur5e/physical_parameters.yaml.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from basecal.geometry import SE3
from basecal.kinematics import Masses, SerialChain
from basecal.simulation.arms import elbow_arm

_JOINT_ORIGINS_M = ((0, 0, 0.1625), (0, 0, 0), (-0.425, 0, 0), (-0.3922, 0, 0.1333), (0, -0.0997, 0), (0, 0.0996, 0))
_MASSES_KG = (3.761, 8.058, 2.846, 1.37, 1.3, 0.365)
_MASS_CENTRES_M = (
    (0, -0.00193, -0.02561),
    (-0.2125, 0, 0.11336),
    (-0.2422, 0, 0.0265),
    (0, -0.01634, -0.0018),
    (0, 0.01634, -0.0018),
    (0, 0, -0.001159),
)
_JOINT_LIMITS_RAD = np.array([2 * np.pi, 2 * np.pi, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])


@cache
def ur5e() -> SerialChain:
    """Kinematic chain of the UR5e from `base_link` to `tool0`."""
    masses = Masses(np.array(_MASSES_KG), np.array(_MASS_CENTRES_M))
    return elbow_arm(_JOINT_ORIGINS_M, SE3.identity(), _JOINT_LIMITS_RAD, masses)
