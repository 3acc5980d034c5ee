"""Zeros of joints as what stops have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.noise.terms.zeros import errors
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_they_move_the_flange_as_offsets_do():
    """To first order as the chain at joints that are off."""
    problem = simulated_problem(SCENARIO)
    at, offsets = posture_at_stops(problem, "eye"), 1e-6 * np.arange(1.0, 7.0)
    off = Kinematics(at.chain, {"joint_offsets": offsets}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(errors(problem, "eye").by_stop @ offsets, moved, atol=1e-10)


def test_estimated_offsets_leave_none():
    """Where offsets, or links which hold them, are estimated, stops have none of them in common."""
    for kind in ("joint_offsets", "link_parameters"):
        estimated = replace(SCENARIO, joint_offset_rad=1e-3, link_error=(1e-4, 1e-4), **{kind: "prior"})
        assert errors(simulated_problem(estimated), "eye") is None
