"""`basecal detect`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.next_step import cameras_without_lens, next_step
from basecal.cli.terminal import finding_line, print_json, progress_bar, quote_path, say
from basecal.errors import count_text

if TYPE_CHECKING:
    from basecal.cell import Cell, Recording

Pair = tuple[str, str]  # a camera and a target


def detect(cell: Path, /, *, json: bool = False) -> int:
    """Find the targets in the images of a recording.

    Detections are cached in CELL/derived and used by `basecal calibrate`, which
    detects targets if needed. Images without a target and images that cannot be
    used are listed.

    Exit code: 0 if there are no findings and every camera has a lens, else 1.

    For example:

        basecal detect mycell
        basecal detect mycell --json

    Args:
        cell: Folder of the cell.
        json: Print the detections as JSON, with pixels and their sigmas.
    """
    from basecal.cell.files import finding_to_dict, read_cell, sample_to_dict

    described = read_cell(cell)
    recording = detected_recording(cell, described, is_forced=True)
    lensless = cameras_without_lens(described, recording)
    if json:
        samples = [sample_to_dict(sample, "recording") for sample in recording.samples]
        print_json({"samples": samples, "findings": [finding_to_dict(finding) for finding in recording.findings]})
    else:
        _print_summary(recording, lensless)
        say(next_step(described, recording, cell) or f"next: basecal calibrate {quote_path(cell)}")
    return 1 if recording.findings or lensless else 0


def detected_recording(folder: Path, cell: Cell, is_forced: bool = False) -> Recording:
    """The recording of a cell's folder with detections in its images; a progress bar is shown.

    Args:
        folder: Folder of the cell.
        cell: The cell.
        is_forced: Whether images are searched even if a unit is implausible, so that no calibration can use them.
    """
    from basecal.accuracy.input_screening.units import needs_search
    from basecal.cell.files import read_recording

    recording = read_recording(folder, cell)
    if not is_forced and not needs_search(cell, recording):
        return recording
    from basecal.vision.detect import detect as detected

    with progress_bar("detecting") as step:
        return detected(cell, recording, progress=step)


def _print_summary(recording: Recording, lensless: Collection[str]) -> None:
    from basecal.cell import PointObservation, PoseObservation, TouchObservation

    images, detected, recorded, points = Counter[str](), Counter[Pair](), Counter[Pair](), Counter[Pair]()
    for sample in recording.samples:
        images.update(sample.images.keys() - set(lensless))
        for view in sample.observations:
            if not isinstance(view, TouchObservation):
                pair = (view.camera, view.target)
                (detected if view.camera in sample.images else recorded)[pair] += 1
                if not isinstance(view, PoseObservation):
                    points[pair] += len(view.points_in_camera if isinstance(view, PointObservation) else view.pixels)
    for pair in sorted(detected | recorded):
        camera, target = pair
        mean_count = points[pair] / (detected[pair] + recorded[pair])
        points_text = f"{mean_count:.1f} points each" if points[pair] else "as poses"
        searched_text = f"in {detected[pair]} of {images[camera]} images of {camera}"
        images_text = searched_text if detected[pair] else f"by {camera}"
        recorded_text = f"{count_text(recorded[pair], 'view')} recorded without an image" if recorded[pair] else ""
        say(", ".join(part for part in (f"{target} {images_text}", recorded_text, points_text) if part))
    if not detected and not recorded and (images or not lensless):
        say(
            f"nothing found in {count_text(sum(images.values()), 'image')}"
            if images
            else "there are no images to search"
        )
    for finding in recording.findings:
        say(finding_line(finding))
