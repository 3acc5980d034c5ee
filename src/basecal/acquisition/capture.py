"""Going through a plan: send the arms, wait until all is still, take states and picture, detect, append to the journal.

Every sample that is told of is on the disk. Cut off at any instant, a capture goes on with the samples of its plan that
are neither in the journal nor given up.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from basecal.acquisition.coverage import Coverage, coverage_of
from basecal.acquisition.freedrive import Key, Led, led_elsewhere
from basecal.acquisition.running.background import BackgroundCheck
from basecal.acquisition.running.check import Doubt
from basecal.acquisition.stillness import Unfit
from basecal.acquisition.taking import Taker
from basecal.bounded_file import read_bounded
from basecal.cell import Cell, Recording, RobotState, Sample
from basecal.cell.files import append_sample, planned, read_plan, read_recording, sample_to_dict, write_plan
from basecal.cell.format.writing import append_durably
from basecal.errors import InputError
from basecal.vision.detect import detect

PLAN = Path("recording", "plan.jsonl")
"""What is to be captured, with the numbers that samples then have."""

GIVEN_UP = Path("recording", "given_up.jsonl")
"""Samples of the plan that could not be taken, and why."""

Replan = Callable[[Sequence[Sample], Sequence[Sample]], Sequence[Sample]]
"""What is still to be taken, by the samples that were and those that could not be."""

_LARGEST_BYTES = 2**26  # of samples given up: a line of each there can be, and why


@dataclass(frozen=True, eq=False)
class Step:
    """What has become of one sample of the plan.

    Attributes:
        sample: Its number.
        why_not: Why it was given up, in words; empty where it was taken.
        taken: How many samples there are now.
        planned: How many the plan has.
        coverage: Of all of them.
        sigma: Of the requested transform, 3-D norms [m] and [rad] as in the report; None while a direction is open.
        doubts: What disagrees, as far as it was not reported before.
    """

    sample: int
    why_not: str
    taken: int
    planned: int
    coverage: Coverage
    sigma: tuple[float, float] | None
    doubts: tuple[Doubt, ...] = ()


def unfinished(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    """Samples of a plan in a cell's folder that are still to be taken; none where there is no plan."""
    if not (folder / PLAN).exists():
        return ()
    done = {sample.sample for sample in _taken(folder, cell)} | _given_up(folder)
    return tuple(sample for sample in read_plan(folder / PLAN, folder, cell) if sample.sample not in done)


def finished(folder: Path, cell: Cell) -> int | None:
    """Number of samples recorded, if there is a plan of which none is left to be taken; else None."""
    if not (folder / PLAN).exists() or unfinished(folder, cell):
        return None
    return len(_taken(folder, cell))


def store_plan(folder: Path, cell: Cell, samples: Sequence[Sample]) -> tuple[Sample, ...]:
    """Samples as they are to be taken, numbered beyond what the recording has, stored in the cell's folder."""
    numbers = [sample.sample for sample in _taken(folder, cell)]
    first = max([*numbers, *_given_up(folder)], default=-1) + 1
    plan = tuple(Sample(first + k, robots=sample.robots) for k, sample in enumerate(samples))
    write_plan(plan, folder / PLAN, folder)
    return plan


def capture(by: Taker, plan: Sequence[Sample], replan: Replan | None = None) -> Iterator[Step]:
    """Take the samples of a plan, one after another; each has become what is told when it is told.

    Args:
        by: What takes them.
        plan: What is to be taken.
        replan: What else is to be taken instead of what is left, after each sample; nothing changes where None.

    A sample that disagrees with those before it is taken once more at the same place.

    Raises:
        InputError: if a file cannot be written, or no camera has a driver.
        DriverError: if a robot or camera does not answer.
    """
    with BackgroundCheck(by.sketch.cell) as check:
        captured = _begun(by, len(plan), check)
        led_from: dict[str, RobotState] = {}
        left = list(plan)
        while left:
            wanted, why_not = left.pop(0), ""
            try:
                led_from = led_elsewhere(by.rig, led_from, by.settings.lead_patience_s)
                found = by.take(wanted, captured.undoubted)
            except Unfit as why:
                why_not = str(why)
                told = {**sample_to_dict(wanted, ""), "why": why_not}
                append_durably(by.folder / GIVEN_UP, json.dumps(told) + "\n", within=by.folder)
            else:
                append_sample(by.folder, replace(found, observations=()))
                captured.add(found)
            if replan is not None:
                by.tell("planning anew")
                instead = replan(captured.taken, given_up(by.folder, by.sketch.cell))
                left = list(store_plan(by.folder, by.sketch.cell, instead))
                captured.planned = len(captured.taken) + len(left)
            step = captured.step(wanted.sample, why_not, is_last=not left)
            if replan is None:
                left = captured.repeated(step, plan, left)
            yield step


def capture_led(by: Taker, samples: int, key: Key) -> Iterator[Step]:
    """Take samples where a person leads the arms to: each time they are held still, or a key is pressed.

    Args:
        by: What takes them.
        samples: After how many it ends.
        key: The key that was pressed since it was last asked.

    Raises:
        InputError: if a file cannot be written, or no camera has a driver.
        DriverError: if a robot or camera does not answer.
    """
    with BackgroundCheck(by.sketch.cell) as check:
        captured = _begun(by, samples, check)
        last = max((sample.sample for sample in captured.taken), default=-1)
        number, end = last + 1, last + 1 + samples
        led = Led(by.rig, key, by.tell)
        while number < end and led.wait():
            try:
                found = by.take(Sample(number), captured.undoubted)
            except Unfit as why:
                yield captured.step(number, str(why))
                continue
            append_sample(by.folder, replace(found, observations=()))
            captured.add(found)
            yield captured.step(number, is_last=number + 1 == end)
            number += 1


class _Captured:
    """Samples taken so far, and what they say."""

    def __init__(self, by: Taker, planned: int, taken: Sequence[Sample], check: BackgroundCheck) -> None:
        self.taken: list[Sample] = []
        self.planned = planned
        self._by, self._check = by, check
        self._doubted: set[int] = set()
        for sample in taken:
            self.add(sample)

    @property
    def undoubted(self) -> list[Sample]:
        """Samples that need not be taken again."""
        return [sample for sample in self.taken if sample.sample not in self._doubted]

    def add(self, sample: Sample) -> None:
        """Count a sample among those taken, and have it checked."""
        self.taken.append(sample)
        self._check.add(sample)

    def step(self, sample: int, why_not: str = "", is_last: bool = False) -> Step:
        """What there is to tell once a sample is taken, or is not and why."""
        waits = is_last or self._by.settings.waits_for_check
        covered, checked = coverage_of(self._by.sketch, self.taken), self._check.found(waits)
        return Step(sample, why_not, len(self.taken), self.planned, covered, checked.sigma, checked.doubts)

    def repeated(self, step: Step, plan: Sequence[Sample], left: Sequence[Sample]) -> list[Sample]:
        """What is left, after the samples of a step's doubts that are worth taking again."""
        again = {doubt.sample for doubt in step.doubts if doubt.repeats} - self._doubted
        number = max(sample.sample for sample in (*plan, *self.taken, *left)) + 1
        places = [sample for sample in plan if sample.sample in again]
        self._doubted |= again
        self.planned += len(places)
        return [*(replace(sample, sample=number + k) for k, sample in enumerate(places)), *left]


def _begun(by: Taker, planned: int, check: BackgroundCheck) -> _Captured:
    if not by.rig.cameras:
        raise InputError("no camera of the cell has a `driver`: say in cell.yaml what gives its pictures")
    recording = Recording(_taken(by.folder, by.sketch.cell), folder=str(by.folder))
    return _Captured(by, planned, detect(by.sketch.cell, recording).samples, check)


def _taken(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    has_journal = (folder / "recording" / "samples.jsonl").exists()
    return read_recording(folder, cell).samples if has_journal else ()


def given_up(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    """Samples that could not be taken, with where robots should have been."""
    lines = [{key: line[key] for key in ("sample", "robots")} for line in _lines(folder) if line.get("robots")]
    return planned([json.dumps(line).encode() for line in lines], folder / GIVEN_UP, folder, cell)


def _given_up(folder: Path) -> set[int]:
    return {int(line["sample"]) for line in _lines(folder)}


def _lines(folder: Path) -> Iterator[dict[str, Any]]:
    """What was given up, but for a line that is cut off or damaged: its sample is tried again."""
    path = folder / GIVEN_UP
    for line in read_bounded(path, _LARGEST_BYTES).splitlines() if path.exists() else []:
        try:
            told = json.loads(line)
            int(told["sample"])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            continue
        yield told
