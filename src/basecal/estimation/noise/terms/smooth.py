"""Errors of an arm that are smooth in its pose: geometry, gears and sag, alike at stops that are near one another.

A Gaussian process over poses with a squared-exponential kernel in sqrt(|dp|^2 + (1 m * angle)^2), by its leading modes:
it varies slowly, so that a dozen describe it. Source: Rasmussen & Williams 2006 (4.2), Williams & Seeger 2001 (modes).
"""

from __future__ import annotations

import numpy as np

from basecal.cell.robot_parameters.kind import Posture
from basecal.estimation.noise.hyperpriors import CommonPrior
from basecal.estimation.noise.robot_noise import stands, stops_made
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.problem.problem import Problem
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import spectrum

# Errors of real arms correlate over 0.5 to 1.3 m, with an arm of 1 m for angles.
LENGTH_M = 0.7
_ARM_M = 1.0
EXPECTED = CommonPrior((2.5, 2.0))  # smooth errors are larger than what differs between neighbouring stops
IS_LEFT = False
IS_SURE = False
FIGURES = {"length_m": LENGTH_M}
_FEWEST_STOPS = 4  # fewer show nothing of how errors change over poses
_MOST_STOPS = 150  # that the modes are found of: more are between these
_MOST_MODES = 16  # of each of six coordinates, which bounds the time
_LEAST_MODE = 1e-2  # of the largest variance: smaller ones are noise of single stops


def errors(problem: Problem, robot: str) -> CommonErrors | None:
    """See `NoiseTerm`."""
    found = modes(problem, robot)
    return CommonErrors.in_every_coordinate(found) if found.shape[1] else None


def at_posture(at: Posture) -> CommonErrors | None:
    """None: it goes by poses, wherever the joints are."""
    return None


def modes(problem: Problem, robot: str) -> Array:
    """What a unit error of each mode is at each stop of a robot, in every coordinate alike, (stops, k)."""
    poses, seen = stands(problem, robot)
    if stops_made(problem, robot) < _FEWEST_STOPS:
        return np.zeros((len(poses), 0))
    few = poses[np.flatnonzero(seen)[:: -(-int(seen.sum()) // _MOST_STOPS)]]
    of = spectrum(kernel(few, few), _LEAST_MODE)
    return np.asarray(kernel(poses, few) @ of.inverse_root[:, of.held][:, -_MOST_MODES:])


def kernel(first: SE3, second: SE3) -> Array:
    """How alike errors are at poses of a flange, (n,) and (m,) to (n, m): 1 at the same."""
    apart = first.translation[:, None] - second.translation[None]
    # The trace of R' S, 1 + 2 cos of the angle between them, is the sum of the products of their entries.
    traces = first.rotation.reshape(-1, 9) @ second.rotation.reshape(-1, 9).T
    turn = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    squared = np.sum(apart**2, -1) + _ARM_M**2 * turn**2
    return np.asarray(np.exp(-0.5 * squared / LENGTH_M**2))
