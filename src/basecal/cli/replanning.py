"""Planning during a capture, with its state as text and as data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from basecal.cli.option_types import Box, Point, task_points
from basecal.errors import UsageError, count_text
from basecal.fields.typed_length import length_m

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from basecal.acquisition.rig import Rig
    from basecal.cell import Cell, RobotState, Sample
    from basecal.cli.plan_options import PlanOptions
    from basecal.planning.sketch import Sketch


class Task(NamedTuple):
    """Points of the task in the reference's base [m], and the tolerance for 95 % of errors there [m], if any."""

    points_m: list[Point]
    tolerance_m: float | None


def requested_task(
    point: Point | None, box: Box | None, tolerance: str | None, may_be_open: bool = False
) -> Task | None:
    """The requested task; None if nothing was requested.

    Args:
        point: Position of the task [m].
        box: Two opposite corners of the task's volume [m].
        tolerance: Length with its unit.
        may_be_open: Whether a task without a tolerance is allowed.

    Raises:
        UsageError: if the task is incomplete.
    """
    if tolerance is None and point is None and box is None:
        return None
    if tolerance is None and not may_be_open:
        raise UsageError("a capture for a task ends at a tolerance: give --tolerance, such as 0.3mm")
    return Task(task_points(point, box), None if tolerance is None else length_m(tolerance))


def detected_samples(folder: Path, cell: Cell) -> Sequence[Sample]:
    """The recorded samples of a cell, with their observations."""
    from basecal.cli.detect import detected_recording

    has_journal = (folder / "recording" / "samples.jsonl").exists()
    return detected_recording(folder, cell).samples if has_journal else ()


class Replanner:
    """The remaining samples, planned again after each sample.

    Attributes:
        tolerance_m: The required error at the task [m].
        samples: The remaining samples.
    """

    def __init__(self, rig: Rig, sketch: Sketch, folder: Path, task: Task, planning: PlanOptions) -> None:
        import numpy as np

        from basecal.acquisition.capture import abandoned_samples
        from basecal.acquisition.replanning import replanner
        from basecal.acquisition.rig import starting_states
        from basecal.cell.files import read_plan
        from basecal.planning.plan import MOST_SAMPLES

        home = starting_states(rig, sketch)
        assert task.tolerance_m is not None
        self._recorded = recorded = detected_samples(folder, sketch.cell)
        candidates = () if planning.plan is None else read_plan(planning.plan, folder, sketch.cell)
        self.tolerance_m = task.tolerance_m
        self._recorded_count, self._max_count = len(recorded), planning.samples or MOST_SAMPLES
        points = np.array(task.points_m)
        seed = planning.seed or 0
        self._replanner = replanner(sketch.cell, recorded, home, points, task.tolerance_m, candidates, seed)
        self._excluded = [*abandoned_samples(folder, sketch.cell)]
        self.samples = self(recorded, self._excluded)

    def exclude(self, samples: Sequence[Sample]) -> Sequence[Sample]:
        """Plan again without refused samples and samples close to them."""
        self._excluded += samples
        return self(self._recorded, self._excluded)

    def __call__(self, samples: Sequence[Sample], exclusions: Sequence[Sample]) -> Sequence[Sample]:
        """Plan the remaining samples, within the limit of their number."""
        self._latest = self._replanner.plan(samples, exclusions)
        remaining_count = max(self._max_count - (len(samples) - self._recorded_count), 0)
        self.samples = self._latest.samples[:remaining_count]
        return self.samples

    @property
    def is_reached(self) -> bool:
        """Whether the samples taken so far reach the tolerance."""
        return bool(self._latest.reachable) and not self._latest.samples

    @property
    def error_m(self) -> float | None:
        """Expected error at the task from the samples taken so far [m]; None if the plan does not contain it."""
        return self._latest.steps[0][1] if self._latest.steps else None

    def as_dict(self) -> dict[str, Any]:
        """The state as plain data."""
        expected_m = self._latest.expected_m
        return {
            "reached": self.is_reached,
            "needed": self._latest.needed,
            "predicted_mm": None if expected_m is None else 1e3 * expected_m,
        }

    def words(self) -> str:
        """The state as text."""
        from basecal.fields.digits import two_digits
        from basecal.reporting.statement.verdict import PLACE_WORDS

        goal = f"{1e3 * self.tolerance_m:g} mm {PLACE_WORDS[self._latest.place]}"
        if self.is_reached:
            expected_m = self._latest.expected_m
            errors = (
                "" if expected_m is None else f": 95 % of errors are expected below {two_digits(1e3 * expected_m)} mm"
            )
            return f"{goal} is reached{errors}"
        if self._latest.reachable:
            return f"{goal} needs {count_text(self._latest.needed or 0, 'more sample')}"
        cause = f"; the largest part of the error is {self._latest.budget[0].source}" if self._latest.budget else ""
        return f"{goal} cannot be reached{cause}"


def shifts_for_task(
    task: Task, cell: Cell, folder: Path, home: Mapping[str, RobotState], count: int | None, seed: int
) -> Sequence[Sample]:
    """Samples of stations of programmed shifts, as many as the tolerance needs, or `count` samples."""
    import numpy as np

    from basecal.acquisition.replanning import stations_for_task

    recorded, points = detected_samples(folder, cell), np.array(task.points_m)
    return stations_for_task(cell, recorded, home, points, task.tolerance_m, count, seed).samples
