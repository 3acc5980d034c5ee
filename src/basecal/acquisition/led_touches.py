"""Touches of tips that a person leads: at each answer the arm has to stand still, and is noted durably."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from basecal.acquisition.freedrive import END_KEY, release_arms
from basecal.acquisition.rig import Rig
from basecal.acquisition.stillness import Unfit, wait_for_arms
from basecal.acquisition.taking import Notify
from basecal.cell import Cell, Sample, TouchObservation
from basecal.cell.files import append_sample
from basecal.errors import InputError, list_names, nearest
from basecal.exchange.importing.imported import recorded_samples

Answer = Callable[[], str]
"""The line that a person typed; None where the input has ended."""

_PATIENCE_S = 5.0  # for an arm that a person has just let go


def take_touches(rig: Rig, cell: Cell, folder: Path, answer: Answer, report: Notify) -> Iterator[Sample]:
    """Touches, each on the disk when it is given; no arm is sent anywhere.

    Args:
        rig: Robots with drivers; those that can be led are free until a line is typed.
        cell: Its tips and marks.
        folder: Of the cell.
        answer: The typed line: a mark, and a tip if there are several. One without words repeats both, "" is the end.
        report: Receives what a person should know.

    Raises:
        InputError: if no robot with a driver has a tip, or the cell has no marks.
        DriverError: if a robot does not answer.
    """
    tips = {name: c.on for name, c in cell.cameras.items() if c.kind == "tip" and c.on in rig.robots}
    marks = [name for name, target in cell.targets.items() if target.is_touched and target.on not in cell.robots]
    if not tips or not marks:
        raise InputError("touches need a tip on a robot with a driver, and marks: state them in cell.yaml")
    number = max((sample.sample for sample in recorded_samples(folder, cell)), default=-1) + 1
    last = list[str]()
    while True:
        report(f"Lead a tip to a mark, type the mark{' and the tip' if len(tips) > 1 else ''}, Enter; q ends.")
        with release_arms(rig.robots.values()):
            line = answer()
        if not line or line.strip() == END_KEY:
            return
        try:
            mark, tip = _parse_contact(line.split() or last, marks, tips)
            robot = tips[tip]
            state = wait_for_arms({robot: rig.robots[robot]}, {}, _PATIENCE_S, rig.arms.note)[robot].state
        except (InputError, Unfit) as why:
            report(f"Not taken: {why}.")
            continue
        last = [mark, tip]
        sample = Sample(number, robots={robot: state}, observations=(TouchObservation(tip, mark),))
        append_sample(folder, sample)
        yield sample
        number += 1


def _parse_contact(words: Sequence[str], marks: Sequence[str], tips: Mapping[str, str]) -> tuple[str, str]:
    """The mark and the tip that words name.

    Raises:
        InputError: if they name none, or leave open which.
    """
    mark, *rest = words or [""]
    tip = rest[0] if rest else next(iter(tips)) if len(tips) == 1 else ""
    for name, kind, known in ((mark, "mark", list(marks)), (tip, "tip", list(tips))):
        if name not in known:
            raise InputError(f"no {kind} {name!r}{nearest(name, known)}; there are: {list_names(known)}")
    return mark, tip
