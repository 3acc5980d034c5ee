"""Tests of tracks combined with a problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.geometry import SE3
from tied_scene import tracks_alone


def test_tracks_in_a_problem_have_the_scenes_information() -> None:
    """Without other views, the information on base, mounts and lenses is that of the scene's own adjustment."""
    _, fit, problem, state = tracks_alone(1)
    own = fit.columns
    where = [own.bases[1], *own.mounts, *own.lenses]
    names = (
        "left_base_from_right_base",
        "left_flange_from_left_eye",
        "right_flange_from_right_eye",
        "left_eye",
        "right_eye",
    )
    alone = [k for each in where if each is not None for k in range(each.start, each.stop)]
    joined = [k for name in names for k in range(problem.columns[name].start, problem.columns[name].stop)]
    information = fit.pixel_information / fit.sigma_px**2
    at = np.arange(own.errors.start, own.errors.stop)
    information[at, at] += (1 / fit.stop_sigma**2).ravel()
    carried = information[np.ix_(alone, at)] @ np.linalg.inv(information[np.ix_(at, at)])
    expected = information[np.ix_(alone, alone)] - carried @ information[np.ix_(at, alone)]
    found = linearise(problem, state).hessian[np.ix_(joined, joined)]
    scale = np.sqrt(np.diag(expected))
    off = (found - expected) / scale / scale[:, None]
    assert np.abs(off[:18]).max() < 5e-4  # the rest includes the prior of the lens terms


def test_problem_of_tracks_alone_equals_the_scene() -> None:
    """From 1 cm and 10 mrad off, the base is that of the scene's own adjustment to 0.1 mm."""
    _, fit, problem, state = tracks_alone(2)
    off = state.transforms["left_base_from_right_base"]
    moved = {**state.transforms, "left_base_from_right_base": off @ SE3.exp(np.full(6, 0.01))}
    end = bundle_adjust(problem, replace(state, transforms=moved), 1.0)
    apart = fit.state.bases[1].inverse() @ end.state.transforms["left_base_from_right_base"]
    assert np.linalg.norm(apart.log()) < 1e-4
