"""Tests of link parameters: their columns, and their fields in `calibration.json`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import RobotParameters
from basecal.effects import link_parameters as of
from basecal.estimation.noise.random_effects import posture_at_stops, shared_errors
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)
SEEN = np.ones((3, 6), dtype=bool)
FOUND = RobotParameters((), np.arange(18.0).reshape(3, 6), np.arange(18.0, 36.0).reshape(3, 6), SEEN)


def test_free_links_scale_half_metre_as_radian(arm):
    """Each tangent of each origin and of the tip has a column; half a metre is weighted like a radian."""
    basis, sigma = of.columns(arm, of.Stated(status="free"))
    np.testing.assert_array_equal(basis, np.diag([0.5, 0.5, 0.5, 1, 1, 1] * 7))
    assert sigma is None


def test_link_prior_covers_every_tangent(arm):
    """The prior's sigmas apply to translations [m] before rotations [rad]."""
    basis, sigma = of.columns(arm, of.Stated(status="prior", sigma_m=0.1, sigma_rad=0.2))
    np.testing.assert_array_equal(basis, np.eye(42))
    np.testing.assert_array_equal(sigma.reshape(7, 6), [[0.1] * 3 + [0.2] * 3] * 7)


def test_link_parameters_round_trip():
    """Translations precede rotations, with their sigmas; all are read back the same.

    Without links the field is null.
    """
    entry = of.to_dict({"arm": FOUND})["link_parameters"]["arm"]
    assert entry["t_m"].tolist() == [[0, 1, 2], [6, 7, 8], [12, 13, 14]]
    assert entry["r_rad"][0].tolist() == [3, 4, 5]
    assert entry["sigma_t_m"][0].tolist() == [18, 19, 20]
    (back,) = of.from_dict({"link_parameters": {"arm": entry}}).values()
    for name in ("values", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))
    assert of.to_dict({}) == {"link_parameters": None}
    assert of.from_dict({"link_parameters": None}) == {}


def test_links_are_reported_in_millimetres_and_degrees():
    """Each origin has a line, numbered from 1, to 0.1 um; values that round to zero have no sign."""
    values = np.array([[1e-3, -2e-3, -1e-9, np.radians(0.5), 0, 0], [0, 0, 0, 0, 0, np.radians(-1)]])
    heading, *lines = of.report("arm", RobotParameters((), values, np.ones((2, 6)), SEEN[:2]))
    assert heading == "link errors of arm, right tangents of each joint's origin, then of the tip"
    assert [line.split() for line in lines] == [
        ["1", "t", "1.0000", "-2.0000", "0.0000", "mm", "r", "0.5000", "0.0000", "0.0000", "deg"],
        ["2", "t", "0.0000", "0.0000", "0.0000", "mm", "r", "0.0000", "0.0000", "-1.0000", "deg"],
    ]


def test_shared_link_errors_move_flange():
    """Errors move the flange to first order like a chain with moved origins.

    Shifts have one sigma, rotations the other.
    """
    problem = simulated_problem(SCENARIO)
    at, tangents = posture_at_stops(problem, "eye"), 1e-7 * np.arange(42.0).reshape(7, 6)
    off = Kinematics(at.chain, {"link_parameters": tangents}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    found = of.shared_errors(at)
    np.testing.assert_allclose(found.by_stop @ tangents.ravel(), moved, atol=1e-9)
    assert found.is_turn.reshape(7, 6).tolist() == [[False] * 3 + [True] * 3] * 7


def test_estimated_links_have_no_random_effect():
    """Estimated links replace the random effect; estimated offsets alone do not."""
    links = replace(SCENARIO, link_error=(1e-4, 1e-4), link_parameters="prior")
    assert shared_errors(of.EFFECT.random, simulated_problem(links), "eye") is None
    offsets = replace(SCENARIO, joint_offset_rad=1e-3, joint_offsets="prior")
    assert shared_errors(of.EFFECT.random, simulated_problem(offsets), "eye") is not None


def test_likely_link_error_states_largest_sigmas():
    """The message states the largest sigma of all robots, separately for shift and rotation."""
    words = of.likely({"eye": np.array([5e-4, np.radians(0.1)]), "hand": np.array([2e-4, np.radians(0.3)])})
    assert words.what == "Links of eye and hand likely differ from the URDF by 0.50 mm and 0.30 deg (1 sigma)."
    assert words.do[0].endswith("at eye and hand.")


def test_drawn_links_have_milliradian_per_millimetre():
    """One row is drawn for each origin and one for the tip."""
    drawn = of.draw_fault(2e-3, 4999, np.random.default_rng(0))
    assert drawn.shape == (5000, 6)
    np.testing.assert_allclose(drawn.std(0), 2e-3, rtol=0.05)
