"""Estimates of each view alone, by the sigma that it scales with, and their degrees of freedom.

A view of many points holds its own estimate of its pose and, where that is free, of the lens. Only this estimate
counts. The residuals of the points about it are noise of single points. Hundreds of them say nothing about what the
points share (blur, print, lens). The estimate of a view counts as many freedoms as its information has.
"""

from __future__ import annotations

from dataclasses import dataclass

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.measurement import Measurement, Noise, ViewInformation
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

STATED = "stated"
_INFINITE_NOISE = Noise(*(float("inf"),) * len(Noise._fields))


@dataclass(frozen=True, eq=False)
class ViewEstimates:
    """Estimates of n views at unit sigma.

    Attributes:
        cost: (n,) above that of their own estimates.
        gradient: (n, q) to pose, lens, and where it is estimated the shape of the target.
        information: (n, q, q) likewise.
        count: Freedoms of all estimates together; a direction of which a view holds next to nothing is a part of one.
        white: Sum of squares of points about them.
        white_count: Its freedoms.
    """

    cost: Array
    gradient: Array
    information: Array
    count: float
    white: float
    white_count: float


def view_estimates(
    problem: Problem, group: ViewGroup, state: State, by_shape: Array | None = None
) -> dict[str, ViewEstimates]:
    """Estimates of a group's views at a state, by field of `Noise` at unit sigma, and those by stated sigmas.

    Args:
        problem: The problem.
        group: Its views.
        state: The state.
        by_shape: How the target's points move by its shape, (p, 3, k) [m]; None if that is not estimated.
    """
    camera = state.cameras.get(group.camera)
    at = state.camera_from_target(group, problem.stops)
    lens = group.camera in problem.columns
    counts = group.measurement.counts()
    return {
        name: _estimates(view, counts.get(name, 0), by_shape)
        for name, view in _parts(group.measurement, at, camera, lens, by_shape).items()
    }


def _parts(
    measurement: Measurement, camera_from_target: SE3, camera: Camera | None, lens: bool, by_shape: Array | None
) -> dict[str, ViewInformation]:
    def information(noise: Noise) -> ViewInformation:
        """The information of the views with such noise."""
        noisy = measurement.with_noise(noise)
        if by_shape is None or not isinstance(noisy, PixelMeasurement):
            return noisy.linearise(camera_from_target, camera, lens)
        return noisy.linearise_shape(camera_from_target, camera, lens, by_shape)

    counts = measurement.counts()
    parts = {STATED: information(_INFINITE_NOISE)} if counts.get(STATED) else {}
    for name, count in counts.items():
        if name != STATED and count:
            both = information(_INFINITE_NOISE._replace(**{name: 1.0}))
            stated = parts.get(STATED)
            parts[name] = (
                both if stated is None else ViewInformation(*(b - s for b, s in zip(both, stated, strict=True)))
            )
    return parts


def _estimates(view: ViewInformation, total: int, by_shape: Array | None) -> ViewEstimates:
    if by_shape is not None and by_shape.shape[-1] == by_shape[..., 0].size:
        # Where every point may be off by itself, nothing of a view is noise of single points alone.
        return ViewEstimates(*view, total, 0.0, 0)
    of = spectrum(view.information)
    counted = of.add_ridge(VIEW_ROUNDING)
    own, count = counted.squared_mahalanobis(view.gradient), float((of.values / counted.values).clip(0.0).sum())
    white = max(float(view.cost.sum() - own.sum()), 0.0)
    return ViewEstimates(own, view.gradient, view.information, count, white, max(total - count, 0.0))
