"""Errors of links as what stops have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.noise.terms.links import errors
from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario, simulate

SCENARIO = Scenario(samples=8, joints=True)


def test_they_move_the_flange_as_links_do():
    """To first order as the chain whose origins are moved; shifts go by one sigma, turns by the other."""
    simulated = simulate(SCENARIO, 2)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    at, tangents = posture_at_stops(problem, "eye"), 1e-7 * np.arange(42.0).reshape(7, 6)
    off = Kinematics(at.chain, {"link_parameters": tangents}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    found = errors(problem, "eye")
    np.testing.assert_allclose(found.by_stop @ tangents.ravel(), moved, atol=1e-9)
    assert found.is_turn.reshape(7, 6).tolist() == [[False] * 3 + [True] * 3] * 7


def test_estimated_links_leave_none():
    """Offsets that are estimated leave the links what they are."""
    links = simulate(replace(SCENARIO, link_error=(1e-4, 1e-4), link_parameters="prior"), 2)
    assert errors(build_problem(links.cell, links.recording)[0], "eye") is None
    offsets = simulate(replace(SCENARIO, joint_offset_rad=1e-3, joint_offsets="prior"), 2)
    assert errors(build_problem(offsets.cell, offsets.recording)[0], "eye") is not None
