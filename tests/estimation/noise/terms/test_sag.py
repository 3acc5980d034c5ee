"""Joints that yield as what stops have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell.robot_parameters import deflection
from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.noise.terms.sag import errors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.kinematics import gravity_torques
from basecal.simulation import Scenario, simulate
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_what_joints_share_moves_the_flange_as_one_compliance_does():
    """The first error is that of all joints yielding alike, by a radian where most torque is on one of them."""
    problem = simulated_problem(SCENARIO)
    at = posture_at_stops(problem, "eye")
    torques = gravity_torques(at.chain, at.recorded)
    most = np.sqrt(np.mean(torques**2, axis=0)).max()
    off = Kinematics(at.chain, {"deflection": np.full(6, 1e-6 / most)}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(errors(problem, "eye").by_stop[:, :, 0] * 1e-6, np.sqrt(0.7) * moved, atol=1e-10)


def test_an_arm_on_the_ceiling_yields_the_other_way():
    """By what the cell states of gravity, though compliances are not estimated."""
    simulated = simulate(SCENARIO, 2)
    eye = replace(simulated.cell.robots["eye"], parameters={"deflection": deflection.Stated(down=[0.0, 0.0, 1.0])})
    cell = replace(simulated.cell, robots={**simulated.cell.robots, "eye": eye})
    hanging, upright = build_problem(cell, simulated.recording)[0], simulated_problem(SCENARIO)
    assert not hanging.models
    np.testing.assert_allclose(errors(hanging, "eye").by_stop, -errors(upright, "eye").by_stop, atol=1e-15)
    np.testing.assert_array_equal(errors(hanging, "hand").by_stop, errors(upright, "hand").by_stop)


def test_arms_without_masses_and_estimated_compliances_have_none():
    """Nothing says what their joints carry, or it is told already."""
    problem = simulated_problem(SCENARIO)
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    assert errors(replace(problem, chains=light), "eye") is None
    assert errors(simulated_problem(replace(SCENARIO, compliance=1e-5, deflection="prior")), "eye") is None


def test_each_error_is_a_turn():
    """That of all joints together, then one of each joint: all of them turn."""
    found = errors(simulated_problem(SCENARIO), "eye")
    assert found.by_stop.shape[-1] == 7
    np.testing.assert_array_equal(found.is_turn, [True] * 7)
