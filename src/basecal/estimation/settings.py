"""Settings of the solver."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from basecal.estimation.stages import StageName, Stages

LOG = logging.getLogger("basecal")
Method = Literal["maximum-likelihood", "axis-shift", "scene"]
Start = Literal["closed", "thorough", "guess", "axis-shift"]
StationChoice = Literal["nearest", "weighted"]
RobotNoise = Literal["stated", "estimated"]
Against = Literal["opencv"]


@dataclass(frozen=True)
class Settings:
    """Settings of a calibration.

    Attributes:
        method: `maximum-likelihood`; `axis-shift`, the paper's closed form; or `scene`, from images of the static
            scene, without a target.
        iterations: Steps of the descent, at most.
        start: One of four. `closed`: a closed form, or a search where the data need it. `thorough`: always a search.
            `guess`: the cell's means and guesses. `axis-shift`: the paper's closed form.
        task_point: (x, y, z) [m] in the reference robot's base, about which the error is reported by source and place.
            The axis-shift method fits best there; for it the point is in the eye robot's base, and None is a mean of
            all stations.
        task_box: With a task point: two opposite corners, (x, y, z, x, y, z) [m] in the same frame, of a part of the
            workspace. This part is calibrated separately as well. If None, the workspace is divided by the places of
            the samples.
        robot_noise: `estimated` if none is stated, together with all other noise, or `stated`: robots that state none
            are exact.
        station_choice: With a task point: the `nearest` station, or all of them `weighted` by distance.
        certify: Prove that no other state fits better, or report why that cannot be proven.
        against: Other methods whose predictions of held-out views are reported beside the answer's; None for none.
        joins_scene: Whether the static scene takes part beside targets.
        stages: Where the time of each stage is counted; no part of what is asked.
    """

    method: Method = "maximum-likelihood"
    iterations: int = 100
    start: Start = "closed"
    task_point: tuple[float, float, float] | None = None
    task_box: tuple[float, float, float, float, float, float] | None = None
    station_choice: StationChoice = "nearest"
    robot_noise: RobotNoise = "estimated"
    certify: bool = False
    against: Against | None = None
    joins_scene: bool = False
    stages: Stages | None = field(default=None, compare=False)

    def as_dict(self) -> dict[str, Any]:
        """The settings as plain values, for files."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "stages"}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Settings:
        """The settings of `as_dict`, as a file holds them; what else it holds is left aside."""
        known: dict[str, Any] = {f.name: values[f.name] for f in fields(cls) if f.name in values}
        return cls(**known | {name: tuple(each) for name, each in known.items() if isinstance(each, list)})

    def stage(self, name: StageName) -> AbstractContextManager[None]:
        """A part of the work: it is logged as it begins, and its time is counted where that is requested."""
        LOG.info("stage: %s", name)
        return nullcontext() if self.stages is None else self.stages.stage(name)

    def part(self, done_count: int, total: int) -> None:
        """How much of the present stage is done."""
        LOG.info("%d of %d", done_count, total)
        if self.stages is not None:
            self.stages.part(done_count, total)


DEFAULT = Settings()
STATED = Settings(robot_noise="stated")
LOG.addHandler(logging.NullHandler())  # quiet, unless who uses this package says where its words go
