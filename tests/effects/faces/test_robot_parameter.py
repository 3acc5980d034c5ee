"""Lines of joints in the report."""

from __future__ import annotations

import numpy as np

from basecal.cell import RobotParameters
from basecal.effects.faces.robot_parameter import joint_lines


def test_lines_of_joints():
    """In the unit requested; what only the prior knows says so, what nothing knows has no number."""
    of = np.array([0.001, -0.0, np.nan])
    found = RobotParameters(("a", "long", "c"), of, np.array([0.01, 0.02, np.nan]), np.array([True, False, False]))
    assert [line.split() for line in joint_lines(found, 1e3, "mm", 1)] == [
        ["1", "a", "+1.0", "mm", "sigma", "10.0", "mm"],
        ["2", "long", "+0.0", "mm", "sigma", "20.0", "mm", "prior-dominated"],
        ["3", "c", "unobservable"],
    ]
