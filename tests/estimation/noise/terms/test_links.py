"""Errors of links as what stops have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.noise.terms.links import errors
from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_they_move_the_flange_as_links_do():
    """To first order as the chain whose origins are moved; shifts go by one sigma, turns by the other."""
    problem = simulated_problem(SCENARIO)
    at, tangents = posture_at_stops(problem, "eye"), 1e-7 * np.arange(42.0).reshape(7, 6)
    off = Kinematics(at.chain, {"link_parameters": tangents}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    found = errors(problem, "eye")
    np.testing.assert_allclose(found.by_stop @ tangents.ravel(), moved, atol=1e-9)
    assert found.is_turn.reshape(7, 6).tolist() == [[False] * 3 + [True] * 3] * 7


def test_estimated_links_leave_none():
    """Offsets that are estimated leave the links what they are."""
    links = replace(SCENARIO, link_error=(1e-4, 1e-4), link_parameters="prior")
    assert errors(simulated_problem(links), "eye") is None
    offsets = replace(SCENARIO, joint_offset_rad=1e-3, joint_offsets="prior")
    assert errors(simulated_problem(offsets), "eye") is not None
