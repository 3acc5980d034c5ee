"""`basecal detect`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.detected import detected_recording
from basecal.cli.terminal import print_json, say

if TYPE_CHECKING:
    from basecal.cell import Recording


def detect(cell: Path, /, *, json: bool = False) -> int:
    """Find the targets in the images of a recording.

    What is found is kept in CELL/derived and taken by `basecal calibrate`,
    which detects by itself where it has to. Images without a target and
    images that cannot be used are listed.

    Ends with 0 where every image shows what it should, else with 1.

    For example:

        basecal detect mycell
        basecal detect mycell --json

    Args:
        cell: Folder of the cell.
        json: Print what was found as JSON, pixels and their sigmas among it.
    """
    from basecal.cell.files import finding_to_dict, read_cell, sample_to_dict

    described = read_cell(cell)
    recording = detected_recording(cell, described)
    if json:
        samples = [sample_to_dict(sample, "recording") for sample in recording.samples]
        print_json({"samples": samples, "findings": [finding_to_dict(finding) for finding in recording.findings]})
    else:
        _print_summary(recording)
    return 1 if recording.findings else 0


def _print_summary(recording: Recording) -> None:
    from basecal.cell import CandidateObservation, PixelObservation

    images, found, points = Counter[str](), Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    for sample in recording.samples:
        images.update(sample.images.keys())
        for seen in sample.observations:
            if isinstance(seen, PixelObservation | CandidateObservation):
                found[seen.camera, seen.target] += 1
                points[seen.camera, seen.target] += len(seen.pixels)
    for pair, count in sorted(found.items()):
        camera, target = pair
        say(f"{target} in {count} of {images[camera]} images of {camera}, {points[pair] / count:.1f} points each")
    if not found:
        say(f"nothing found in {sum(images.values())} images")
    for finding in recording.findings:
        say(f"{finding.severity}: {finding.code}: {finding.message}")
