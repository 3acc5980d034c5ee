"""Settings of the solver."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, fields
from math import isfinite
from numbers import Real
from typing import Any, Literal, get_args

from basecal.errors import InputError, check_choice, check_integer, check_type, count_text
from basecal.estimation.stages import StageName, Stages

LOG = logging.getLogger("basecal")

MOST_STEPS = 100
"""Most steps of a descent; assumed: a descent that needs more is reported as not converged."""
Method = Literal["maximum-likelihood", "axis-shift", "scene"]
Start = Literal["closed", "thorough", "guess", "axis-shift"]
StationChoice = Literal["nearest", "weighted"]
RobotNoise = Literal["stated", "estimated"]
Against = Literal["opencv"]

_CHOICES = {
    "method": get_args(Method),
    "start": get_args(Start),
    "station_choice": get_args(StationChoice),
    "robot_noise": get_args(RobotNoise),
}


@dataclass(frozen=True)
class Settings:
    """Settings of a calibration.

    Attributes:
        method: `maximum-likelihood`; `axis-shift`, the paper's closed form; or `scene`, from images of the static
            scene, without a target.
        iterations: Most steps of the descent.
        start: One of four. `closed`: a closed form, or a search if the data need it. `thorough`: always a search.
            `guess`: the cell's means and guesses. `axis-shift`: the paper's closed form.
        task_point: (x, y, z) [m] in the reference robot's base, at which the error is reported by source and place.
            For the axis-shift method, the point is in the eye robot's base and the fit is best there; None takes the
            mean of all stations.
        task_box: With a task point: two opposite corners, (x, y, z, x, y, z) [m] in the same frame, of a part of the
            workspace. This part is also calibrated separately. If None, the workspace is divided by the places of
            the samples.
        robot_noise: `estimated`: unstated noise of robots is estimated together with all other noise. `stated`: robots
            without stated noise are assumed exact.
        station_choice: With a task point: the `nearest` station, or all stations `weighted` by distance.
        certify: Prove that no other state fits better, or report why this cannot be proven.
        against: Method to compare with: its predictions of held-out views are reported in addition; None for none.
        joins_scene: Whether images of the static scene are used in addition to targets.
        stages: Counter of the time of each stage; not part of the saved settings.

    Raises:
        InputError: if a value is not one of its choices, or a point or box has non-finite numbers.
    """

    method: Method = "maximum-likelihood"
    iterations: int = MOST_STEPS
    start: Start = "closed"
    task_point: tuple[float, float, float] | None = None
    task_box: tuple[float, float, float, float, float, float] | None = None
    station_choice: StationChoice = "nearest"
    robot_noise: RobotNoise = "estimated"
    certify: bool = False
    against: Against | None = None
    joins_scene: bool = False
    stages: Stages | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        if self.against is not None:
            check_choice("against", self.against, get_args(Against))
        if self.stages is not None:
            check_type("stages", self.stages, Stages)
        for name in ("certify", "joins_scene"):
            check_type(name, getattr(self, name), bool)
        check_integer("iterations", self.iterations, 1)
        for name, count in (("task_point", 3), ("task_box", 6)):
            object.__setattr__(self, name, _finite_numbers(name, getattr(self, name), count))
        if self.task_box is not None and self.task_point is None:
            raise InputError("task_box needs a task_point: give the middle of the box")
        if self.task_box is not None and any(a == b for a, b in zip(self.task_box[:3], self.task_box[3:], strict=True)):
            raise InputError(f"task_box is {self.task_box!r}, expected two corners that differ in x, in y and in z")

    def as_dict(self) -> dict[str, Any]:
        """Convert the settings to plain values, for files."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "stages"}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Settings:
        """Make settings from the values of `as_dict`; other keys are ignored."""
        return cls(**{f.name: values[f.name] for f in fields(cls) if f.name in values})

    def stage(self, name: StageName) -> AbstractContextManager[None]:
        """Context of a stage: log its begin, and count its time if `stages` is set."""
        LOG.info("stage: %s", name)
        return nullcontext() if self.stages is None else self.stages.stage(name)

    def report_progress(self, done_count: int, total: int) -> None:
        """Report how much of the present stage is done."""
        LOG.info("%d of %d", done_count, total)
        if self.stages is not None:
            self.stages.report_progress(done_count, total)


def _finite_numbers(name: str, numbers: Any, count: int) -> tuple[float, ...] | None:
    """Convert to a tuple of `count` finite numbers [m]; None stays None."""
    if numbers is None:
        return None
    values = tuple(numbers) if isinstance(numbers, Iterable) else ()
    if len(values) != count or not all(isinstance(each, Real) and isfinite(each) for each in values):
        raise InputError(f"{name} is {numbers!r}, expected {count_text(count, 'finite number')} [m]")
    return tuple(map(float, values))


DEFAULT = Settings()
STATED = Settings(robot_noise="stated")
LOG.addHandler(logging.NullHandler())  # silent unless the application configures logging
