"""Executing a plan: move the arms, wait until they are still, read states and images, detect, append to the journal.

Every reported sample is on the disk. A capture that was interrupted at any time resumes with the samples of its plan
that are neither in the journal nor given up.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from basecal.acquisition.coverage import Coverage
from basecal.acquisition.freedrive import HandGuiding, Key, wait_for_hand_guided_arms
from basecal.acquisition.rig import check_cameras
from basecal.acquisition.running.background import BackgroundCheck
from basecal.acquisition.running.check import Doubt
from basecal.acquisition.stillness import Unfit
from basecal.acquisition.taking import Taker
from basecal.bounded_file import read_bounded
from basecal.cell import Cell, Recording, RobotState, Sample
from basecal.cell.files import append_sample, parse_plan, read_plan, sample_to_dict, write_plan
from basecal.cell.format.writing import append_durably
from basecal.errors import count_text
from basecal.exchange.importing.imported import recorded_samples
from basecal.vision.detect import detect

PLAN_FILE = Path("recording", "plan.jsonl")
"""Numbered samples that are to be captured."""

ABANDONED_FILE = Path("recording", "given_up.jsonl")
"""Samples of the plan that could not be taken, with the reasons."""

Replan = Callable[[Sequence[Sample], Sequence[Sample]], Sequence[Sample]]
"""Function of the samples taken and the samples given up that returns the samples still to be taken."""

_LARGEST_BYTES = 2**26  # of the file of samples given up


@dataclass(frozen=True, eq=False)
class Step:
    """The result of one sample of the plan.

    Attributes:
        sample: Number of the sample.
        why_not: Reason why the sample was given up; empty if it was taken.
        taken: Number of samples so far.
        planned: Number of samples at the end of the capture.
        coverage: Coverage of all samples so far.
        sigma: 3-D norms of the requested transform's sigmas [m] and [rad], as in the report; None if unobservable.
        doubts: Disagreements that were not reported before.
        unchecked: Number of the last samples that the sigma does not include yet.
    """

    sample: int
    why_not: str
    taken: int
    planned: int
    coverage: Coverage
    sigma: tuple[float, float] | None
    doubts: tuple[Doubt, ...] = ()
    unchecked: int = 0

    @property
    def sigma_note(self) -> str:
        """Note about a sigma that does not include the last samples, such as ", after 12 samples"; else empty."""
        return f", after {count_text(self.taken - self.unchecked, 'sample')}" if self.unchecked else ""


def remaining_samples(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    """Samples of the plan in a cell's folder that are still to be taken; empty without a plan."""
    if not (folder / PLAN_FILE).exists():
        return ()
    done = {sample.sample for sample in recorded_samples(folder, cell)} | _abandoned_numbers(folder)
    return tuple(sample for sample in read_plan(folder / PLAN_FILE, folder, cell) if sample.sample not in done)


def finished_count(folder: Path, cell: Cell) -> int | None:
    """Number of recorded samples if there is a plan and it is complete; else None."""
    if not (folder / PLAN_FILE).exists() or remaining_samples(folder, cell):
        return None
    return len(recorded_samples(folder, cell))


def store_plan(folder: Path, cell: Cell, samples: Sequence[Sample]) -> tuple[Sample, ...]:
    """Store a plan in the cell's folder; its samples, numbered after those of the recording."""
    numbers = [sample.sample for sample in recorded_samples(folder, cell)]
    first = max([*numbers, *_abandoned_numbers(folder)], default=-1) + 1
    plan = tuple(Sample(first + k, robots=sample.robots) for k, sample in enumerate(samples))
    write_plan(plan, folder / PLAN_FILE, folder)
    return plan


def capture(taker: Taker, plan: Sequence[Sample], replan: Replan | None = None) -> Iterator[Step]:
    """Take the samples of a plan one after another; each sample is on the disk before its step is yielded.

    Without `replan`, a sample that disagrees with earlier ones is repeated at the same place.

    Args:
        taker: Procedure that takes a sample.
        plan: The planned samples.
        replan: Returns new samples in place of the remaining plan after each sample; None to keep the plan.

    Raises:
        InputError: if a file cannot be written, or no camera has a driver.
        DriverError: if a robot or camera does not answer.
    """
    with BackgroundCheck(taker.sketch.cell) as check:
        progress = _begin_capture(taker, len(plan), check)
        previous_states: dict[str, RobotState] = {}
        remaining = list(plan)
        while remaining:
            planned, reason = remaining.pop(0), ""
            try:
                previous_states = wait_for_hand_guided_arms(taker.rig, previous_states, taker.settings.lead_patience_s)
                sample = taker.take(planned, progress.trusted_samples)
            except Unfit as why:
                reason = str(why)
                line = {**sample_to_dict(planned, ""), "why": reason}
                append_durably(taker.folder / ABANDONED_FILE, json.dumps(line) + "\n", base_folder=taker.folder)
            else:
                _store(taker, sample)
                progress.add(sample)
            if replan is not None:
                taker.notify("planning again")
                new_plan = replan(progress.taken, abandoned_samples(taker.folder, taker.sketch.cell))
                remaining = list(store_plan(taker.folder, taker.sketch.cell, new_plan))
                progress.planned = len(progress.taken) + len(remaining)
            step = progress.step(planned.sample, reason, is_last=not remaining)
            if replan is None:
                remaining = progress.repeat_doubtful(step, plan, remaining)
            yield step


def capture_by_hand(taker: Taker, samples: int, key: Key) -> Iterator[Step]:
    """Take samples while a person leads the arms: each time they are held still, or a key is pressed.

    Args:
        taker: Procedure that takes a sample.
        samples: Number of samples after which the capture ends.
        key: Returns the key pressed since the previous call.

    Raises:
        InputError: if a file cannot be written, or no camera has a driver.
        DriverError: if a robot or camera does not answer.
    """
    with BackgroundCheck(taker.sketch.cell) as check:
        progress = _begin_capture(taker, samples, check)
        last = max((sample.sample for sample in progress.taken), default=-1)
        number, end = last + 1, last + 1 + samples
        guiding = HandGuiding(taker.rig, key, taker.notify)
        while number < end and guiding.wait():
            try:
                sample = taker.take(Sample(number), progress.trusted_samples)
            except Unfit as why:
                yield progress.step(number, str(why))
                continue
            _store(taker, sample)
            progress.add(sample)
            yield progress.step(number, is_last=number + 1 == end)
            number += 1


class _Progress:
    """Samples taken so far, and the results of their running check."""

    def __init__(self, taker: Taker, planned_count: int, samples: Sequence[Sample], check: BackgroundCheck) -> None:
        self.taken: list[Sample] = []
        self.planned = planned_count
        self._taker, self._check = taker, check
        self._doubted: set[int] = set()
        for sample in samples:
            self.add(sample)

    @property
    def trusted_samples(self) -> list[Sample]:
        """Samples without doubts."""
        return [sample for sample in self.taken if sample.sample not in self._doubted]

    def add(self, sample: Sample) -> None:
        """Add a sample, and start its check."""
        self.taken.append(sample)
        if self._taker.scene is None:
            self._check.add(sample)

    def step(self, sample: int, reason: str = "", is_last: bool = False) -> Step:
        """The step of a sample that was taken, or of one that was given up for a reason."""
        waits = is_last or self._taker.settings.waits_for_check
        covered, checked = self._taker.coverage(self.taken), self._check.collect(waits)
        return Step(sample, reason, len(self.taken), self.planned, covered, **vars(checked))

    def repeat_doubtful(self, step: Step, plan: Sequence[Sample], remaining_samples: Sequence[Sample]) -> list[Sample]:
        """The remaining plan, preceded by the doubtful samples of a step that are to be repeated."""
        doubtful = {doubt.sample for doubt in step.doubts if doubt.repeats} - self._doubted
        number = max(sample.sample for sample in (*plan, *self.taken, *remaining_samples)) + 1
        repeated = [sample for sample in plan if sample.sample in doubtful]
        self._doubted |= doubtful
        self.planned += len(repeated)
        return [*(replace(sample, sample=number + k) for k, sample in enumerate(repeated)), *remaining_samples]


def _store(taker: Taker, sample: Sample) -> None:
    """Append a sample to the journal, without what was detected; report a repair of the journal."""
    if repair := append_sample(taker.folder, replace(sample, observations=())):
        taker.report(repair.message)


def _begin_capture(taker: Taker, planned_count: int, check: BackgroundCheck) -> _Progress:
    check_cameras(taker.rig)
    recording = Recording(recorded_samples(taker.folder, taker.sketch.cell), folder=str(taker.folder))
    planned_count += len(recording.samples)
    taker.remember(recording.samples)
    if taker.scene is not None:
        taker.scene.check_carriers(taker.rig.cameras, taker.rig.robots)
        for sample in recording.samples:
            with suppress(Unfit):
                taker.scene.check(sample)
    return _Progress(taker, planned_count, detect(taker.sketch.cell, recording).samples, check)


def abandoned_samples(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    """Samples that could not be taken, with the planned robot states."""
    lines = [
        {key: line[key] for key in ("sample", "robots")} for line in _abandoned_lines(folder) if line.get("robots")
    ]
    return parse_plan([json.dumps(line).encode() for line in lines], folder / ABANDONED_FILE, folder, cell)


def _abandoned_numbers(folder: Path) -> set[int]:
    return {int(line["sample"]) for line in _abandoned_lines(folder)}


def _abandoned_lines(folder: Path) -> Iterator[dict[str, Any]]:
    """Lines of samples that were given up; a damaged line is omitted, and its sample is tried again."""
    path = folder / ABANDONED_FILE
    for line in read_bounded(path, _LARGEST_BYTES).splitlines() if path.exists() else []:
        try:
            line_data = json.loads(line)
            int(line_data["sample"])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            continue
        yield line_data
