"""Tests of the finding `identity-poses`."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, problem_of, views

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.identity_poses import identity_poses
from basecal.cell import Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize(("mount", "severity"), [("free", "warning"), ("fixed", "info")])
def test_robot_with_identity_poses_is_named(mount, severity):
    """A robot whose poses are all the identity is named with what to check; one other pose is enough to avoid it."""
    made = simulate(Scenario(samples=4, target="led", camera_mount=mount), 0)
    still = RobotState(SE3.identity())
    samples = [replace(s, robots={**s.robots, "eye": still}) for s in made.recording.samples]
    found = identity_poses(Input(build_problem(made.cell, Recording(tuple(samples)))[0], ()))
    assert [(f.code, f.severity, f.about) for f in found] == [("identity-poses", severity, ("eye",))]
    assert "Check that the driver of" in found[0].message
    samples[2] = made.recording.samples[2]
    assert identity_poses(Input(build_problem(made.cell, Recording(tuple(samples)))[0], ())) == []


def test_only_robots_with_poses_are_named():
    """Only robots with poses are named, not devices on the world.

    An arm given by joints is not named: its flange may be anywhere.
    """
    still = SE3.identity((3,))
    unknowns = {name: SimpleNamespace(status="free") for name in ("camera", "target")}
    for joints, about in ((None, [("arm",)]), (np.zeros((3, 6)), [])):
        arm = end("arm", still, mount="target", joints=joints)
        problem = problem_of(views(end(None, still, mount="camera"), arm), unknowns=unknowns)
        assert [f.about for f in identity_poses(Input(problem, ()))] == about
