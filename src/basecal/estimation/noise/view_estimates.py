"""Estimates from each view alone, by the sigma that scales them, and their degrees of freedom.

A view of many points determines its own pose and, if the lens is free, the lens. The noise model uses only this
estimate. The residuals of points about it are noise of single points. Even hundreds of them carry no information about
errors that the points share (blur, print, lens). The degrees of freedom of an estimate are the rank of its information.
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
        cost: (n,) cost in excess of each view's own optimum.
        gradient: (n, q) with respect to the pose, the lens and, if it is estimated, the shape of the target.
        information: (n, q, q) information of the same parameters.
        count: Degrees of freedom of all estimates; a direction with almost no information counts as a fraction.
        white: Sum of squared residuals of points about the views' own optima.
        white_count: Degrees of freedom of `white`.
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
    """Estimate each view of a group alone, by field of `Noise` at unit sigma, and `STATED` for stated sigmas.

    Args:
        problem: The problem.
        group: A group of views.
        state: The state to expand about.
        by_shape: Derivative of the target's points with respect to its shape, (p, 3, k) [m]; None if not estimated.
    """
    camera = state.cameras.get(group.camera)
    camera_from_target = state.camera_from_target(group, problem.stops)
    lens = group.camera in problem.columns
    counts = group.measurement.counts()
    return {
        name: _estimates(view, counts.get(name, 0), by_shape)
        for name, view in _parts(group.measurement, camera_from_target, camera, lens, by_shape).items()
    }


def _parts(
    measurement: Measurement, camera_from_target: SE3, camera: Camera | None, lens: bool, by_shape: Array | None
) -> dict[str, ViewInformation]:
    def information(noise: Noise) -> ViewInformation:
        """Linearise the views with the given noise."""
        noisy = measurement.with_noise(noise)
        if by_shape is None or not isinstance(noisy, PixelMeasurement):
            return noisy.linearise(camera_from_target, camera, lens)
        return noisy.linearise_shape(camera_from_target, camera, lens, by_shape)

    counts = measurement.counts()
    parts = {STATED: information(_INFINITE_NOISE)} if counts.get(STATED) else {}
    for name, count in counts.items():
        if name != STATED and count:
            combined = information(_INFINITE_NOISE._replace(**{name: 1.0}))
            stated = parts.get(STATED)
            parts[name] = (
                combined if stated is None else ViewInformation(*(b - s for b, s in zip(combined, stated, strict=True)))
            )
    return parts


def _estimates(view: ViewInformation, total: int, by_shape: Array | None) -> ViewEstimates:
    if by_shape is not None and by_shape.shape[-1] == by_shape[..., 0].size:
        # If each point may have its own error in the target, no residual is noise of single points alone.
        return ViewEstimates(*view, total, 0.0, 0)
    decomposed = spectrum(view.information)
    with_ridge = decomposed.add_ridge(VIEW_ROUNDING)
    excess, count = (
        with_ridge.squared_mahalanobis(view.gradient),
        float((decomposed.values / with_ridge.values).clip(0.0).sum()),
    )
    white = max(float(view.cost.sum() - excess.sum()), 0.0)
    return ViewEstimates(excess, view.gradient, view.information, count, white, max(total - count, 0.0))
