"""Every kind of robot parameters, whichever are registered."""

from __future__ import annotations

import numpy as np
import pytest
from tests.derivatives import check_derivative

from basecal.cell import RobotParameters
from basecal.cell.robot_parameters.kind import Posture, joint_lines, robot_parameter_kinds
from basecal.registry import ROBOT_PARAMETERS
from basecal.simulation.arms import six_axis

ARM = six_axis()
JOINTS = np.random.default_rng(0).uniform(-2, 2, (4, 6))


def flange(kind, values):
    true = JOINTS + kind.shift(ARM, kind.Stated(), JOINTS, values)
    return kind.moved(ARM, values).forward(true)


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_zero_is_the_robot_as_stated(name):
    """Nothing moves, and what was not looked for is stated as fixed."""
    kind = robot_parameter_kinds()[name]
    np.testing.assert_array_equal(flange(kind, kind.zero(6)).matrix, ARM.forward(JOINTS).matrix)
    assert kind.Stated().status == "fixed"


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_the_derivative_is_that_of_the_flange(name):
    """To each value, at values of some size."""
    kind = robot_parameter_kinds()[name]
    values = 0.1 * kind.SCALE * np.random.default_rng(1).standard_normal(kind.zero(6).shape)
    true, moved = JOINTS + kind.shift(ARM, kind.Stated(), JOINTS, values), kind.moved(ARM, values)
    at = Posture(ARM, JOINTS, moved.at(true))
    before = flange(kind, values).inverse()

    def after(step):
        return (before @ flange(kind, values + kind.SCALE * step.reshape(values.shape))).log()

    check_derivative(after, kind.SCALE * kind.derivative(at, kind.Stated(), values))


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_what_was_found_is_written_read_and_told(name):
    """A heading with the robot's name and a line at least; the fields of the calibration give it back."""
    kind = robot_parameter_kinds()[name]
    values = np.arange(kind.zero(6).size, dtype=float).reshape(kind.zero(6).shape)
    joints = ARM.joint_names if kind.BY_JOINT else ()
    covariance = np.eye(values.size) if kind.BY_JOINT else None
    found = RobotParameters(joints, values, np.ones(values.shape), np.ones(values.shape, dtype=bool), covariance)
    np.testing.assert_array_equal(kind.from_dict(kind.to_dict({"arm": found}))["arm"].values, values)
    heading, *lines = kind.report("arm", found)
    assert "arm" in heading
    assert len(lines) == len(values)


def test_lines_of_joints():
    """In the unit asked for; what only the prior knows says so, what nothing knows has no number."""
    of = np.array([0.001, -0.0, np.nan])
    found = RobotParameters(("a", "long", "c"), of, np.array([0.01, 0.02, np.nan]), np.array([True, False, False]))
    assert [line.split() for line in joint_lines(found, 1e3, "mm", 1)] == [
        ["1", "a", "+1.0", "mm", "sigma", "10.0", "mm"],
        ["2", "long", "+0.0", "mm", "sigma", "20.0", "mm", "prior-dominated"],
        ["3", "c", "unobservable"],
    ]
