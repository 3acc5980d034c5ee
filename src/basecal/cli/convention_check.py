"""Report of conventions at the end of an import, if the cell is complete."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.detection import counting
from basecal.cli.next_step import name_folder
from basecal.cli.terminal import progress, say
from basecal.errors import BasecalError

if TYPE_CHECKING:
    from basecal.cell import Cell, Finding, Recording


def say_conventions(folder: Path, cell: Cell, recording: Recording) -> tuple[Finding, ...]:
    """Report whether what is recorded closes its loops as it was read, by a few of its samples.

    Args:
        folder: The cell's, where detections are kept.
        cell: As it is now.
        recording: Likewise, whole.

    Returns:
        Errors: what was certainly read otherwise than it was meant.
    """
    from basecal.accuracy.input_screening.quick_look import QuickLook, preview_samples, quick_look

    few = preview_samples(recording)
    try:
        if any(sample.images for sample in few.samples):
            from basecal.vision.detect import detect

            with counting("looking at images") as step:
                few = detect(cell, few, folder, progress=step)
    except BasecalError as error:
        look = QuickLook(0, untold=str(error))
    else:
        with progress("testing conventions"):
            look = quick_look(cell, few, len(few.samples) == len(recording.samples))
    for finding in look.findings:
        message = name_folder(finding, folder).message
        say(f"basecal: warning: {finding.code}, by {look.views} views: {message}", sys.stderr)
    if look.error is not None:
        others = "no other direction, unit, order or pairing does better"
        say(f"conventions hold: each of {look.views} views is predicted by the others to {look.error}, and {others}")
    elif not look.findings:
        say(f"conventions are not determined by {look.views} views: {look.untold}")
    return tuple(finding for finding in look.findings if finding.severity == "error")
