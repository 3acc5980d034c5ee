"""How well a base is known after each sample: information added up, nothing solved.

What a sample says is linearised where the cell's own values are. These are rough, so is the sigma: good to some
percent, which is enough to see whether more samples are worth their time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Recording, Sample
from basecal.errors import BasecalError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum
from basecal.planning.sketch import Sketch

_PIXEL_PX = 0.15  # of a detected point where the cell states no noise
_ROBOT = np.repeat([1e-4, 2e-4], 3)  # [m, rad] of a recorded pose where the cell states none: a good arm
_KNOWN = 0.3  # [m, rad] of a sigma: above, a direction has not been seen


@dataclass(frozen=True, eq=False)
class RunningEstimate:
    """What all samples so far say.

    Attributes:
        sketch: Where it is linearised.
        name: The transform whose sigma is told.
        information: (p, p) of all unknowns; None before the first sample.
    """

    sketch: Sketch
    name: str
    information: Array | None = None

    def added(self, sample: Sample) -> RunningEstimate:
        """With one sample more; the same where it says nothing that can be used."""
        cell = self.sketch.cell
        # Noise that is not stated is taken for a usual one.
        robots = {
            name: robot if robot.noise is not None else replace(robot, noise=_ROBOT)
            for name, robot in cell.robots.items()
        }
        known = replace(cell, robots=robots, pixel_px=cell.pixel_px or _PIXEL_PX)
        try:
            problem, _ = build_problem(known, Recording((sample,)))
        except BasecalError:
            return self
        if not problem.groups:
            return self
        lenses = {name: camera.intrinsics.camera for name, camera in cell.cameras.items() if camera.intrinsics}
        cameras = {name: lens for name, lens in lenses.items() if lens is not None and name in problem.lenses}
        state = State(dict(self.sketch.transforms), cameras, np.zeros((len(problem.stops), 6)))
        of_sample = linearise(problem, state).hessian
        if self.information is None:
            return replace(self, information=of_sample)
        return replace(
            self, information=self.information + of_sample - linearise(problem.with_groups(()), state).hessian
        )

    def sigma(self) -> tuple[float, float] | None:
        """Root of the mean square of the sigmas along [m] and about [rad] the axes; None while a direction is open."""
        columns = self._columns()
        if self.information is None or columns is None:
            return None
        found = spectrum(self.information)
        sigmas = np.sqrt(np.maximum(np.diag(found.inverse)[columns], 0.0))
        if found.rank < len(self.information) or not np.all((sigmas > 0) & (sigmas < _KNOWN)):
            return None
        return float(np.sqrt(np.mean(sigmas[:3] ** 2))), float(np.sqrt(np.mean(sigmas[3:] ** 2)))

    def _columns(self) -> slice | None:
        at = 0
        points = (
            {self.sketch.target.name} if self.sketch.target.target and self.sketch.target.target.is_point else set()
        )
        for name, unknown in self.sketch.cell.transforms.items():
            width = 3 if any(name.endswith(f"_from_{point}") for point in points) else 6
            if unknown.status == "fixed":
                continue
            if name == self.name:
                return slice(at, at + width)
            at += width
        return None


def running_estimate(sketch: Sketch) -> RunningEstimate:
    """What is known before the first sample, of the first transform that the cell asks for."""
    return RunningEstimate(sketch, next(iter(sketch.cell.asked), ""))
