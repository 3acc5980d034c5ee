"""How far off points are expected to be that a calibration carries from one frame to another, where the arms worked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammainc

from basecal.accuracy.residuals.fitted_again import FittedAgain
from basecal.cell import Calibration, Cell
from basecal.estimation.problem.problem import ViewGroup
from basecal.geometry import Array
from basecal.geometry.rotation import hat

LEVEL = 0.95
_DIRECTIONS = 4096  # on the sphere, over which the mean is exact to 1e-4 of the quantile for a covariance of any shape


@dataclass(frozen=True, eq=False)
class ExpectedError:
    """What the covariance of a transform `a_from_b` means at a point.

    Attributes:
        transform: Its name.
        length_m: The distance that the error of a point's position in a stays below in 95 cases of 100 [m].
        at_m: (3,) the point in b [m]: of all places where the arms worked the one that is known least.
    """

    transform: str
    length_m: float
    at_m: Array


@dataclass(frozen=True)
class ToleranceCheck:
    """Whether what was asked for is known as well as is needed.

    Attributes:
        tolerance_m: What is needed [m].
        expected_m: The largest of the expected errors [m]; None where something asked for was not found.
        passed: Whether that is within the tolerance and the verdict is good, without which it proves nothing.
    """

    tolerance_m: float
    expected_m: float | None
    passed: bool

    def as_dict(self) -> dict[str, float | bool | None]:
        """Plain data, as `--json` prints it."""
        return {"tolerance_m": self.tolerance_m, "expected_m": self.expected_m, "passed": self.passed}


def expected_errors(cell: Cell, calibration: Calibration, fitted: FittedAgain) -> tuple[ExpectedError, ...]:
    """The expected error of each transform asked for, where it is used most uncertainly.

    A base is used at the recorded flanges of its robot, the mount of a camera where its targets are, the mount of a
    target at its points; the robots' own errors come on top.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        fitted: The recording at its transforms.
    """
    found = []
    for name in cell.asked:
        if name not in calibration.transforms or not np.all(np.isfinite(calibration[name].covariance)):
            continue
        places = np.concatenate([np.zeros((0, 3)), *_places(name, cell, fitted)])
        if len(places):
            covariances = at_points(calibration[name].covariance, places)
            worst = int(np.argmax(np.trace(covariances, axis1=1, axis2=2)))
            found.append(ExpectedError(name, length_quantile(covariances[worst]), places[worst]))
    return tuple(found)


def check_tolerance(cell: Cell, calibration: Calibration, errors: Sequence[ExpectedError]) -> ToleranceCheck | None:
    """Whether everything asked for is known to the tolerance that the settings state; None where they state none."""
    tolerance_m = calibration.settings.get("tolerance_m")
    if tolerance_m is None:
        return None
    complete = {each.transform for each in errors} == set(cell.asked)
    expected_m = max((each.length_m for each in errors), default=0.0) if complete else None
    within = expected_m is not None and expected_m <= tolerance_m
    return ToleranceCheck(tolerance_m, expected_m, within and calibration.verdict == "good")


def length_quantile(covariance: Array, level: float = LEVEL) -> float:
    """The length that a normal vector of mean zero and this covariance, (3, 3), stays below with this probability.

    Along a direction u, uniform on the sphere, the vector is chi L u, with chi of three degrees of freedom and L L' the
    covariance: the probability is the mean over u of that of chi < length / |L u|.
    """
    variances = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    if variances[-1] <= 0:
        return 0.0
    largest = float(np.sqrt(variances[-1]))
    stretched = np.sqrt(sphere(_DIRECTIONS) ** 2 @ (variances / variances[-1]))

    def excess(length: float) -> float:
        """Its probability beyond the level."""
        return float(np.mean(gammainc(1.5, (length / stretched) ** 2 / 2))) - level

    # Between the quantiles of a normal number and of a normal vector that is as uncertain in every direction.
    return largest * float(brentq(excess, 1.0, 4.0))


def sphere(count: int) -> Array:
    """Directions spread evenly, (count, 3). Source: Gonzalez 2010, the Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=-1)


def at_points(covariance: Array, places: Array) -> Array:
    """Covariances of points' positions, (n, 3, 3), in the axes of the source of a transform with this one, (6, 6)."""
    moved = np.concatenate([np.broadcast_to(np.eye(3), (len(places), 3, 3)), -hat(places)], axis=-1)
    at: Array = moved @ covariance @ np.swapaxes(moved, 1, 2)
    return at


def _places(name: str, cell: Cell, fitted: FittedAgain) -> Iterator[Array]:
    """Where a transform `a_from_b` is used, in b, (n, 3) of each group of views."""
    for group in fitted.problem.groups:
        if name == group.eye_base:
            yield group.eye_base_from_eye_flange.translation
        if name == group.hand_base:
            yield group.hand_base_from_hand_flange.translation
        if name == group.camera_mount:
            yield fitted.state.camera_from_target(group, fitted.problem.stops).translation
        if name == group.target_mount:
            yield _points(cell, group)


def _points(cell: Cell, group: ViewGroup) -> Array:
    """Of a target, (n, 3) [m]; its origin where it is seen only as poses."""
    shape = cell.targets[group.target].target
    return np.zeros((1, 3)) if shape is None else shape.points
