"""Views reduced to what they say to second order, by the sigma that it goes with.

At a state, all that a view says is a cost, a gradient and an information, each a sum over parts that scale with one
sigma. These do not grow with the number of points, so that many sigmas can be tried at little cost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, ViewGroup
from basecal.estimation.view.measurement import Noise, ViewInformation
from basecal.geometry import SE3, Array, Camera, IntArray, Rows

STATED = "stated"
_NEVER = Noise(*(float("inf"),) * len(Noise._fields))


@dataclass(frozen=True, eq=False)
class CompressedMeasurement:
    """Views to second order about their poses at a state.

    Attributes:
        camera_from_target: (n,) where they were taken.
        lens: The lens's parameters there; None for a measurement without one.
        parts: What the views say at unit sigmas, by field of `Noise`, and what goes by stated sigmas.
        weight: 1 / sigma^2 of each part.
        held: `equations` of the measurement.
    """

    camera_from_target: SE3
    lens: Array | None
    parts: Mapping[str, ViewInformation]
    weight: Mapping[str, float]
    held: IntArray

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        moved = (self.camera_from_target.inverse() @ camera_from_target).log()
        if lens and camera is not None and self.lens is not None:
            by_lens = (camera.parameters - self.lens)[..., None, :]
            moved = np.concatenate([moved, np.broadcast_to(by_lens, (*moved.shape[:-1], by_lens.shape[-1]))], -1)
        names = list(self.parts)
        cost, gradient, information = (
            sum(self.weight[name] * getattr(self.parts[name], field) for name in names)
            for field in ViewInformation._fields
        )
        carried = (information @ moved[..., None])[..., 0]
        return ViewInformation(
            cost + np.einsum("...i,...i->...", moved, 2 * gradient + carried),
            gradient + carried,
            np.broadcast_to(information, (*moved.shape, moved.shape[-1])),
        )

    def squares(self, camera_from_target: SE3, camera: Camera | None, lens: bool = False) -> dict[str, float]:
        """See `Measurement`; to second order, and of what states its sigma too."""
        return {
            name: float(replace(self, parts={name: part}).linearise(camera_from_target, camera, lens).cost.sum())
            for name, part in self.parts.items()
        }

    def with_noise(self, noise: Noise) -> CompressedMeasurement:
        """See `Measurement`."""
        unstated = {name: getattr(noise, name) ** -2 for name in self.parts if name != STATED}
        return replace(self, weight={**self.weight, **unstated})

    def with_factor(self, factor: float) -> CompressedMeasurement:
        """The same with stated variances multiplied by a factor."""
        return replace(self, weight={**self.weight, STATED: 1 / factor})

    def take(self, views: Rows) -> CompressedMeasurement:
        """See `Measurement`."""
        parts = {name: ViewInformation(*(of[views] for of in part)) for name, part in self.parts.items()}
        return replace(self, camera_from_target=self.camera_from_target[views], parts=parts, held=self.held[views])

    def of_batch(self, rows: Rows) -> CompressedMeasurement:
        """See `Measurement`: all rows of a batch saw the same."""
        return self

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return self.held

    def counts(self) -> dict[str, int]:
        """See `Measurement`: no residual is left to be counted."""
        return {}


def compressed(problem: Problem, state: State) -> Problem:
    """The problem with every view to second order at a state, at the sigmas of `Noise()` where none is stated."""
    return problem.with_groups(_compressed(problem, group, state) for group in problem.groups)


def _compressed(problem: Problem, group: ViewGroup, state: State) -> ViewGroup:
    camera = state.cameras.get(group.camera)
    at = state.camera_from_target(group, problem.stops)
    lens = group.camera in problem.columns
    measurement = group.measurement
    stated = measurement.with_noise(_NEVER).linearise(at, camera, lens)
    parts = {STATED: stated}
    for name, count in measurement.counts().items():
        if name != STATED and count:
            both = measurement.with_noise(_NEVER._replace(**{name: 1.0})).linearise(at, camera, lens)
            parts[name] = ViewInformation(*(b - s for b, s in zip(both, stated, strict=True)))
    of = CompressedMeasurement(
        at,
        None if camera is None else camera.parameters,
        parts,
        dict.fromkeys(parts, 1.0),
        measurement.equations(),
    )
    return replace(group, measurement=of.with_noise(Noise()), readings=())
