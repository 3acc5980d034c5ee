"""Joints that yield as what stops have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.noise.terms.sag import errors
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.kinematics import gravity_torques
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_what_joints_share_moves_the_flange_as_one_compliance_does():
    """The first error is that of all joints yielding alike, by a radian where most torque is on one of them."""
    problem = simulated_problem(SCENARIO)
    at = posture_at_stops(problem, "eye")
    torques = gravity_torques(at.chain, at.recorded, np.array([0.0, 0.0, -1.0]))
    most = np.sqrt(np.mean(torques**2, axis=0)).max()
    off = Kinematics(at.chain, {"deflection": np.full(6, 1e-6 / most)}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(errors(problem, "eye").by_stop[:, :, 0] * 1e-6, np.sqrt(0.7) * moved, atol=1e-10)


def test_arms_without_masses_and_estimated_compliances_have_none():
    """Nothing says what their joints carry, or it is told already."""
    problem = simulated_problem(SCENARIO)
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    assert errors(replace(problem, chains=light), "eye") is None
    assert errors(simulated_problem(replace(SCENARIO, compliance=1e-5, deflection="prior")), "eye") is None
