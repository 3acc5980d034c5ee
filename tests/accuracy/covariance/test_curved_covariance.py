"""Arcs along which transforms are hardly known: the truth is within the ellipsoid, however well the rest is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.journeys.raw import BOARD, LENS

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.covariance.curved_covariance import curved_covariance
from basecal.estimation.solve import solve
from basecal.geometry import Array
from basecal.simulation import Scenario, SimulatedCell, simulate

BASE = "eye_base_from_hand_base"
KEPT = {"camera": LENS, "board": BOARD, "distance_m": (0.35, 0.55), "joints": True, "pixel_px": 0.0075}
DRAWS, HOLD = 16, 0.9999


def exact_joints(samples: int, seed: int, **more: object) -> SimulatedCell:
    """Two arms whose joints are recorded exactly, but for offsets known to 2 deg."""
    told = {"joint_offset_rad": np.radians(2), "joint_offsets": "prior"}
    return simulate(Scenario(samples=samples, **{**KEPT, **told, **more}), seed)  # type: ignore[arg-type]


def squared_error(made: SimulatedCell, mean: object, covariance: Array) -> float:
    """Of the base, in sigmas."""
    off = (mean.inverse() @ made.truth[BASE]).log()  # type: ignore[attr-defined]
    return float(off @ np.linalg.solve(covariance, off))


def test_an_arc_is_within_the_ellipsoid() -> None:
    """The first joints' offsets turn the base by degrees; the linear ellipsoid is micrometres thin."""
    made = exact_joints(20, 9)
    solution = solve(made.cell, made.recording)
    linear, mean = solution.joint_transform_covariance([BASE]), solution.state.transforms[BASE]
    assert squared_error(made, mean, linear) > 1e3
    assert squared_error(made, mean, linear + curved_covariance(solution, [BASE])) < chi2.ppf(HOLD, 6)


def test_what_is_known_well_has_no_arc() -> None:
    """Then nothing is added, and nothing is computed."""
    made = exact_joints(20, 9, joint_offset_rad=0.0, joint_offsets="fixed", robot_noise=(1e-4, 2e-4))
    assert not curved_covariance(solve(made.cell, made.recording), [BASE]).any()


@pytest.mark.slow
def test_exact_joints_are_answered_and_within() -> None:
    """Nothing is refused; NEES/6 is that of normals, 0.6 to 1.5 of 16 draws of six numbers with long tails."""
    squares = []
    for seed in range(100, 100 + DRAWS):
        made = exact_joints(40, seed, intrinsics="free", state_robot_noise=False)
        found = calibrate(made.cell, made.recording)
        assert found.verdict != "refused", found.unobservable
        squares.append(squared_error(made, found[BASE].mean, found[BASE].covariance))
    assert max(squares) < chi2.ppf(1 - 1e-5, 6)
    assert 0.6 < np.mean(squares) / 6 < 1.5


def test_errors_that_stops_share_are_no_arc() -> None:
    """The arc of an arm whose offsets have a prior is no longer by offsets of the other arm, which are in its noise.

    States of the equations without that noise, along directions that it widens, gave the base four times this sigma.
    """
    told = {"joints": True, "joint_offset_rad": 0.01, "joint_offsets": "prior", "state_robot_noise": False}
    made = simulate(Scenario(samples=25, **told), 4)  # type: ignore[arg-type]
    robots = {**made.cell.robots, "hand": replace(made.cell.robots["hand"], parameters={})}
    base = calibrate(replace(made.cell, robots=robots), made.recording)[BASE]
    assert base.sigma_norms[0] < 0.015
    assert squared_error(made, base.mean, base.covariance) < chi2.ppf(HOLD, 6)
