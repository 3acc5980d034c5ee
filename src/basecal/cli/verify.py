"""`basecal verify`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.detected import counting
from basecal.cli.runs import run_of
from basecal.cli.terminal import print_json, say


def verify(cell: Path, samples: Path, /, *, against: Path | None = None, json: bool = False) -> int:
    """Tell from one or a few new samples whether a cell is still as calibrated.

    Says whether anything moved, what (a base, a camera, a target, the zero of
    a joint) and by how much with its sigma, and which shift would have been
    seen. SAMPLES is a file of lines as in recording/samples.jsonl, its images
    in the recording's folder; or a folder that poses and pictures of the same
    robots and cameras were imported into. Nothing is written.

    Ends with 0 where nothing moved, with 1 where something did or that cannot
    be told, so that a scheduled check can raise an alarm. Where nothing moved
    one check in two hundred says otherwise by chance.

    For example:

        basecal verify mycell today.jsonl
        basecal verify mycell today
        basecal verify mycell today.jsonl --json
        basecal verify mycell today.jsonl --against mycell/runs/20260102T030405Z

    Args:
        cell: Folder of the cell.
        samples: New samples, one JSON object a line; or the folder of a cell that they were imported into.
        against: Folder of the run to verify; the latest where none is given.
        json: Print one JSON object instead of words.
    """
    from basecal.accuracy.drift.verify import verify as verified
    from basecal.cell.files import read_calibration, read_cell, read_samples
    from basecal.reporting.drift_text import verification_dict, verification_text

    described = read_cell(cell)
    calibration = read_calibration(run_of(cell) if against is None else against)
    is_cell = samples.is_dir()
    journal = samples / "recording" / "samples.jsonl" if is_cell else samples
    recording = read_samples(journal, samples if is_cell else cell, described)
    if any(sample.images for sample in recording.samples):
        from basecal.vision.detect import detect

        with counting("detecting") as step:
            recording = detect(described, recording, progress=step)
    found = verified(described, calibration, recording)
    if json:
        print_json(verification_dict(found))
    else:
        say(verification_text(found))
    return 0 if found.moved is False else 1
