"""An effect that a score test found, and the words that effects have for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum

FIX = "Or let `basecal fix CELL` do so."
"""What to do about what the files of a cell allow to fix."""

AGAIN = "Calibrate again when it is fixed."


class Words(NamedTuple):
    """A finding in words.

    Attributes:
        code: Of the finding.
        what: The problem, with its number and unit.
        do: What to do, sentences.
        why: The cause, if it is known.
        severity: Of the finding, if the effect was not found by a test.
    """

    code: str
    what: str
    do: tuple[str, ...]
    why: str = ""
    severity: Literal["warning", "info"] = "warning"


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """An effect that the residuals show, and noise does not explain.

    Attributes:
        effect: Its name.
        code: Of its candidate, such as `joint-offset`.
        about: The robot, camera, target or transform that has it.
        is_camera: Whether that is a camera.
        is_target: Whether that is a target.
        since: Number of the first sample that has it; None if all samples do.
        unit: Unit of the sizes.
        size: (q,) correction of the recording.
        covariance: (q, q).
        moved: (p,) shift of the answer's columns when the recording is corrected.
        joint: Which joint of the robot has it, from 0; None if none does.
        is_certain: Whether chance is excluded; other effects predict held-out blocks better all the same.
        alternatives: Effects that the data do not distinguish from it.
        share: How probable it is, so that it widens the answer by as much of the variance.
    """

    effect: str
    code: str
    about: str
    is_camera: bool
    is_target: bool
    since: int | None
    unit: str
    size: Array
    covariance: Array
    moved: Array
    joint: int | None = None
    is_certain: bool = True
    alternatives: tuple[FoundEffect, ...] = ()
    share: float = 1.0

    @property
    def sigma(self) -> float:
        """Sigma of a single size."""
        return float(np.sqrt(self.covariance[0, 0]))


def format_with_sigma(value: float, sigma: float) -> str:
    """A value with its sigma to two digits."""
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma, 1e-9))), 0, 9))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def rounded_length(values: Array, covariance: Array, unit: float = 1.0) -> str:
    """Length of a vector with its sigma, both times a unit."""
    length = float(np.linalg.norm(values))
    along = values / max(length, 1e-300)
    sigma = float(np.sqrt(max(float(along @ covariance @ along), 0.0)))
    return format_with_sigma(unit * length, unit * sigma)


def format_tangent(size: Array, covariance: Array) -> str:
    """` by` the translation [mm] and rotation [deg] of a tangent, (6,), or of a point, (3,), with their sigmas.

    Of each what is known to be more than its sigma; nothing if neither is.
    """
    parts = (slice(0, 3), 1e3, "mm"), (slice(3, 6), float(np.degrees(1)), "deg")
    told = []
    for where, unit, name in parts:
        known = _known_part(size[where], covariance[where, where])
        if known.any():
            told.append(f"{rounded_length(known, covariance[where, where], unit)} {name}")
    return " by " + " and ".join(told) if told else ""


def _known_part(size: Array, covariance: Array) -> Array:
    """A vector without the directions that are known least, as many as make it shorter than its sigma; else zero."""
    axes = scaled_spectrum(covariance, 0.0).vectors
    for count in range(len(size), 0, -1):
        part = axes[:, :count] @ (axes[:, :count].T @ size)
        if (part @ part) ** 2 > part @ covariance @ part:
            return np.asarray(part)
    return np.zeros_like(size)
