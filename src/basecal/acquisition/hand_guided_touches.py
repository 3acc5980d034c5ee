"""Touches of tips that a person leads: at each typed line, the arm must be still, and the touch is stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from basecal.acquisition.freedrive import END_KEY, release_arms
from basecal.acquisition.rig import Rig
from basecal.acquisition.stillness import Unfit, wait_for_arms
from basecal.acquisition.taking import Notify
from basecal.cell import Cell, Sample, TouchObservation
from basecal.cell.files import append_sample
from basecal.errors import InputError, list_names, spelling_hint
from basecal.exchange.importing.imported import recorded_samples

ReadLine = Callable[[], str]
"""Function that returns the line that a person typed; "" at the end of the input."""

_PATIENCE_S = 5.0  # timeout for an arm to come to rest after a person released it


def take_touches(rig: Rig, cell: Cell, folder: Path, read_line: ReadLine, report: Notify) -> Iterator[Sample]:
    """Record touches, each written to the disk before it is yielded; no arm moves by program.

    Args:
        rig: Robots with drivers; robots with a freedrive are free until a line is typed.
        cell: The cell, with tips and marks.
        folder: The cell's folder.
        read_line: Returns a typed line: a mark, and a tip if there are several; an empty line repeats both, "" ends.
        report: Receives messages for the user.

    Raises:
        InputError: if no robot with a driver has a tip, or the cell has no marks.
        DriverError: if a robot does not answer.
    """
    tips = {
        name: camera.on for name, camera in cell.cameras.items() if camera.kind == "tip" and camera.on in rig.robots
    }
    marks = [name for name, target in cell.targets.items() if target.is_touched and target.on not in cell.robots]
    if not tips or not marks:
        raise InputError("touches need a tip on a robot with a driver, and marks: state them in cell.yaml")
    number = max((sample.sample for sample in recorded_samples(folder, cell)), default=-1) + 1
    last = list[str]()
    while True:
        report(f"Lead a tip to a mark, type the mark{' and the tip' if len(tips) > 1 else ''}, Enter; q ends.")
        with release_arms(rig.robots.values()):
            line = read_line()
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
        if repair := append_sample(folder, sample):
            report(repair.message)
        yield sample
        number += 1


def _parse_contact(words: Sequence[str], marks: Sequence[str], tips: Mapping[str, str]) -> tuple[str, str]:
    """Parse the names of a mark and a tip; the only tip may be omitted.

    Raises:
        InputError: if a name is missing or unknown.
    """
    mark, *rest = words or [""]
    tip = rest[0] if rest else next(iter(tips)) if len(tips) == 1 else ""
    for name, kind, known in ((mark, "mark", list(marks)), (tip, "tip", list(tips))):
        if name not in known:
            raise InputError(f"no {kind} {name!r}{spelling_hint(name, known)}; there are: {list_names(known)}")
    return mark, tip
