"""What every import does at its end: it is checked, brought into the cell, and told."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from basecal.cli.convention_check import say_conventions
from basecal.cli.next_step import next_step
from basecal.cli.terminal import pasted, say
from basecal.errors import InputError, listed

if TYPE_CHECKING:
    from basecal.cell import Cell, Recording
    from basecal.exchange.importing.bring_in import Brought
    from basecal.exchange.importing.imported import Imported

By = Literal["order", "image", "sample", "stamp_s"]
_IN_WORDS = {
    "order": "in order",
    "image": "by the names of pictures",
    "sample": "by the number of the sample",
    "stamp_s": "by time",
}


def finish_import(
    folder: Path,
    imported: Imported,
    *,
    advice: str,
    by: By | None = None,
    link: bool = False,
    is_strict: bool = True,
) -> int:
    """The exit code, after all that was read is in the cell and told; nothing is where that fails.

    Args:
        folder: The cell, or where one is to be made.
        imported: What was read.
        advice: What to do where something cannot be as it was read: which option is likely to be wrong.
        by: What rows and samples are paired by; None for what both have.
        link: Whether pictures are linked instead of copied.
        is_strict: Whether what cannot be is left out; else it is told.

    Raises:
        InputError: if it cannot be as it was read, does not fit the cell, or would overwrite what is recorded.
    """
    from basecal.exchange.importing.bring_in import bring_in

    doubts: list[str] = []  # told once all is written: a command that fails says one line

    def check(cell: Cell, recording: Recording) -> None:
        """Keep what cannot be; see `_impossible`."""
        doubts.extend(_impossible(imported.source, cell, recording, advice, is_strict))

    brought = bring_in(folder, imported, check, by, link)
    for doubt in doubts:
        say(f"basecal: warning: {doubt}", sys.stderr)
    for line in (f"read {imported.source}: {imported.what}", *_pairing_lines(brought)):
        say(line)
    if brought.changed and not brought.is_new_cell:
        say(f"written into cell.yaml: {listed(brought.changed)}")
    missing = next_step(brought.cell, brought.recording, folder)
    then = missing or f"next: basecal calibrate {pasted(folder)}"
    if missing is None and say_conventions(folder, brought.cell, brought.recording):
        then = "mend what is said above first, in cell.yaml or by importing anew into another folder"
    if brought.pairing is None:
        say(f"wrote {folder / 'cell.yaml'}: {then}")
        return 0
    count = len(brought.recording.samples)
    told = f"wrote {count} samples" if brought.made == count else f"completed the {count} samples"
    if 0 < brought.made < count:
        told += f", {brought.made} of them new,"
    made = " and cell.yaml" if brought.is_new_cell else ""
    say(f"{told}{made} {'to' if brought.made == count else 'of'} {folder}: {then}")
    return 0


def _impossible(source: str, cell: Cell, recording: Recording, advice: str, is_strict: bool) -> list[str]:
    """What of a recording cannot be, in a line; none where all can.

    Raises:
        InputError: if something cannot, and that is not merely to be told.
    """
    from basecal.accuracy.input_check.plausibility import impossible_input

    found = impossible_input(cell, recording)
    told = f"{source}: {'; '.join(found)}: that cannot be"
    if found and is_strict:
        raise InputError(f"{told}, nothing is imported; {advice}")
    return [f"{told}; {advice}"] if found else []


def _pairing_lines(brought: Brought) -> list[str]:
    pairing = brought.pairing
    if pairing is None:
        return []
    lines = []
    joined = sum(number is not None for number in pairing.numbers) - brought.made
    if joined:
        lines.append(f"paired with {joined} samples {_IN_WORDS[pairing.by]}")
    if pairing.unpaired_rows:
        lines.append(f"not paired, and left out: {listed(pairing.unpaired_rows)}")
    if pairing.unpaired_samples:
        lines.append(f"samples that nothing was imported to: {listed([str(n) for n in pairing.unpaired_samples])}")
    return lines


def robot_entry(folder: Path, robot: str) -> dict[str, Any]:
    """What `cell.yaml` must have for a robot: its name, and that of the reference where there is no cell yet."""
    entry: dict[str, Any] = {} if (folder / "cell.yaml").exists() else {"reference": robot}
    return entry | {"robots": {robot: {}}}
