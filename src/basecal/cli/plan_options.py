"""Options that determine the plan of a capture; an interrupted plan is not continued with others."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from basecal.bounded_file import read_bounded
from basecal.cli.option_types import Box, Point, Seed, number_range
from basecal.errors import DatasetError, UsageError, count_text

DEFAULT_SAMPLES = 25
DEFAULTS = {"--pattern": "poses", "--samples": DEFAULT_SAMPLES, "--seed": 0}
"""Values of options that are not given."""

_OPTIONS_FILE = Path("recording", "plan_options.json")
_LARGEST_BYTES = 2**16  # of that file


@Parameter(name="*")
@dataclass(frozen=True)
class PlanOptions:
    """Options that determine the plan of a capture; None if they are not given.

    Attributes:
        pattern: poses (varied poses, the default), shifts (the paper's), or a file of samples with the robot states to
            record at.
        plan: File of samples to record, from `basecal plan -o`; the same as --pattern FILE. With --tolerance its
            samples are candidates in addition to others.
        task_point: Task position x y z [m] in the reference robot's base.
        task_box: Task volume, by two opposite corners, instead of a point.
        tolerance: Length with its unit, such as 0.2mm, below which 95 % of position errors at the task must be.
        samples: Number of samples, 25 by default; shifts are rounded up to whole stations of seven. With --tolerance
            the largest number, 60 by default.
        seed: Seed of the plan, 0 by default.
    """

    pattern: str | None = None
    plan: Path | None = None
    task_point: Point | None = None
    task_box: Box | None = None
    tolerance: str | None = None
    samples: Annotated[int | None, number_range(1, 10_000)] = None
    seed: Seed | None = None

    @property
    def given_values(self) -> dict[str, object]:
        """The given options by name, as JSON holds them."""
        values = {f"--{name.replace('_', '-')}": value for name, value in vars(self).items() if value is not None}
        given: dict[str, object] = json.loads(json.dumps(values, default=str))
        return given


def store_plan_options(folder: Path, planning: PlanOptions) -> None:
    """Store the given options of a plan in the cell's folder.

    Raises:
        InputError: if the file cannot be written.
    """
    from basecal.cell.format.writing import write_atomically

    write_atomically(folder / _OPTIONS_FILE, json.dumps(planning.given_values) + "\n", base_folder=folder)


def refuse_other_options(planning: PlanOptions, folder: Path, remaining_count: int) -> None:
    """Refuse options that differ from those of the interrupted plan, if these are stored.

    Raises:
        UsageError: if an option differs.
        DatasetError: if the stored options are unreadable.
    """
    from basecal.acquisition.capture import PLAN_FILE

    if not (folder / _OPTIONS_FILE).exists():
        return
    earlier = _read_options(folder / _OPTIONS_FILE)
    known = earlier if "--plan" in earlier else {**DEFAULTS, **earlier}
    made_with = " ".join(f"{name} {_option_text(value)}" for name, value in earlier.items()) or "the default options"
    for name, value in planning.given_values.items():
        if known.get(name) != value:
            raise UsageError(
                f"{name} {_option_text(value)} is of another plan than the interrupted one, with "
                f"{count_text(remaining_count, 'sample')} left. That one was made with {made_with}. "
                f"Leave {name} out to continue it, or remove {folder / PLAN_FILE} to begin another one"
            )


def _read_options(path: Path) -> dict[str, object]:
    """Stored options by name.

    Raises:
        DatasetError: if the file is no JSON object.
    """
    try:
        options = json.loads(read_bounded(path, _LARGEST_BYTES))
        if isinstance(options, dict):
            return options
    except (ValueError, RecursionError):
        pass
    raise DatasetError(path, "expected a JSON object with the options of the interrupted plan; remove the file")


def _option_text(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
