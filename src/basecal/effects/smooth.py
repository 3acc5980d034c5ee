"""Errors of an arm that are a smooth function of its pose, as of geometry, gears and sag: nearly equal at close stops.

The model is a Gaussian process over poses with a squared-exponential kernel in sqrt(|dp|^2 + (1 m * angle)^2), reduced
to its leading modes. The process varies slowly, so that a dozen modes describe it. Source: Rasmussen & Williams 2006
(4.2), Williams & Seeger 2001 (modes).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from basecal.effects.faces.effect import Effect, Face, RandomEffect
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import spectrum

Kernel = Callable[[Any, Any], Array]
"""Correlation of errors between n and m poses or instants, (n, m)."""

# Errors of real arms correlate over 0.5 to 1.3 m, with a lever of 1 m for angles.
LENGTH_M = 0.7
_ARM_M = 1.0
_MOST_STOPS = 150  # from which the modes are computed; further stops are interpolated
_MOST_MODES = 16  # of each of six coordinates, which bounds the run time
_LEAST_MODE = 1e-2  # share of the largest variance: weaker modes are noise of single stops


class Modes(NamedTuple):
    """Modes of a smooth error: recorded poses or instants and weights determine the value of each mode elsewhere."""

    recorded: SE3 | Array
    weights: Array
    kernel: Kernel

    @classmethod
    def strongest(
        cls,
        stops: SE3 | Array,
        kernel: Kernel,
        most_stops: int = _MOST_STOPS,
        most_modes: int = _MOST_MODES,
        least_share: float = _LEAST_MODE,
    ) -> Modes:
        """The strongest modes of a kernel at recorded poses or instants, (n,).

        Args:
            stops: Poses or instants.
            kernel: The kernel.
            most_stops: Maximum number of stops from which the modes are computed.
            most_modes: Maximum number of modes.
            least_share: The smallest variance of a mode, as a share of the largest.
        """
        few = stops[:: -(-len(stops) // most_stops)]
        modes = spectrum(kernel(few, few), least_share)
        return cls(few, modes.inverse_root[:, modes.is_informative][:, -most_modes:], kernel)

    def values(self, stops: SE3 | Array) -> Array:
        """Values of each mode at poses or instants, (n,), for a unit error, (n, k)."""
        return np.asarray(self.kernel(stops, self.recorded) @ self.weights)


def errors(recorded_poses: SE3, poses: SE3) -> SharedErrors | None:
    """Errors of each coordinate at poses, (n,), by modes of recorded poses, (m,)."""
    modes = Modes.strongest(recorded_poses, kernel).values(poses)
    return SharedErrors.repeat_coordinates(modes) if modes.shape[1] else None


def kernel(first: SE3, second: SE3) -> Array:
    """Correlation of errors between flange poses, (n,) and (m,) to (n, m); 1 between equal poses."""
    difference = first.translation[:, None] - second.translation[None]
    # The trace of R' S, 1 + 2 cos of the angle between them, is the sum of the products of their entries.
    traces = first.rotation.reshape(-1, 9) @ second.rotation.reshape(-1, 9).T
    turn = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    return correlation(np.sum(difference**2, -1) + _ARM_M**2 * turn**2)


def correlation(squared_distance_m2: Array) -> Array:
    """Correlation of smooth errors by their squared distance [m^2]."""
    return np.asarray(np.exp(-0.5 * squared_distance_m2 / LENGTH_M**2))


FIGURES = {"length_m": LENGTH_M}
"""Numbers that `calibration.json` stores in addition to the sigmas of smooth errors."""

_EVERY_ARM = "a stand-in for the effects of joints and links on arms that record poses alone"

ABSENT: dict[Face, str] = {
    "statement": _EVERY_ARM,
    "unknown": "a function of the pose, not a number",
    "candidate": "only its sigma can be estimated, not its value",
    "map": "the error map uses its variance, as it has no values at joints",
    "fault": "joint-offsets, link-errors and sag make such errors",
}
"""Faces that smooth errors lack, with the reason."""

EFFECT = Effect(
    "smooth",
    random=RandomEffect(
        SharedPrior((2.5, 2.0), "assumed: larger than what differs between neighbouring stops"),
        "smooth over {length_m:g} m",
        by_poses=errors,
        is_by_coordinate=True,
        figures=FIGURES,
    ),
    absent=ABSENT,
)
