"""`recording/samples.jsonl`: an append-only journal with one sample per line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.cell.calibration import Finding
from basecal.cell.cell import Cell, CellCamera
from basecal.cell.format.paths import own_file, path_resolver
from basecal.cell.format.writing import append_durably, is_json, write_atomically
from basecal.cell.journal.sample_dict import sample_to_dict
from basecal.cell.journal.sample_line import DroppedSample, make_context, sample_from_line
from basecal.cell.journal.sample_values import FileLine
from basecal.cell.recording import PixelObservation, Recording, Sample
from basecal.cell.schema.cell_file import read_cell
from basecal.errors import DatasetError, InputError, check_type
from basecal.geometry import Array

FOLDER = "recording"
FILE = "samples.jsonl"
MOST_SAMPLES = 200_000
"""Largest number of samples in a recording: one per second for two days."""

LARGEST_BYTES = 2**28
"""Largest size of a recording [bytes]: 256 MB, a thousand views of 5000 points each."""

_LONGEST_LINE_BYTES = 2**24  # 16 MB: 400,000 points
BOM = b"\xef\xbb\xbf"
"""UTF-8 byte order mark, which some editors write at the start of a file."""
_MARGIN_SHARE = 0.05  # of the image's width: noise of points at the border is smaller, a wrong image size exceeds it
_OUTSIDE_SHARE = 0.05  # of the points; a smaller share is left to outlier detection


def read_recording(folder: str | Path, cell: Cell | None = None) -> Recording:
    """Read the recording of a cell, with findings about dropped samples.

    Args:
        folder: The cell's folder.
        cell: The cell; read from the folder if None.

    Raises:
        DatasetError: if the cell, or a line of the recording, cannot be read as written.
    """
    checked_cell = read_cell(folder) if cell is None else cell
    path = own_file(folder, f"{FOLDER}/{FILE}")
    advice = "there is no recording: basecal capture or basecal import makes one, or write it (docs/data_format.md)"
    text = read_bounded(path, LARGEST_BYTES, advice)
    return recording_from_text(text, folder, checked_cell)


def read_samples(path: str | Path, folder: str | Path, cell: Cell) -> Recording:
    """Read samples of a cell from a journal at any path; image paths are relative to the cell's own recording.

    Raises:
        DatasetError: if a line cannot be read as written.
    """
    text = read_bounded(path, LARGEST_BYTES, "expected new samples of the cell, one JSON object a line")
    return _recording(text, str(path), folder, cell)


def recording_from_text(text: bytes, folder: str | Path, cell: Cell) -> Recording:
    """Parse the text of a cell's journal as a recording.

    Raises:
        DatasetError: if a line cannot be read as written.
    """
    return _recording(text, str(Path(folder) / FOLDER / FILE), folder, cell)


def write_recording(recording: Recording, folder: str | Path) -> Path:
    """Write all samples atomically to a new `samples.jsonl` and return its path.

    Raises:
        InputError: if the argument is not a recording, the file exists, a number is not finite, or writing fails.
    """
    check_type("recording", recording, Recording)
    path = Path(folder) / FOLDER / FILE
    if path.exists() and path.stat().st_size:
        raise InputError(f"{path} exists; a recording is never rewritten: choose another folder, or append samples")
    write_atomically(path, "".join(map(sample_line, recording.samples)), base_folder=Path(folder))
    return path


def append_sample(folder: str | Path, sample: Sample) -> Finding | None:
    """Append a sample to the journal and flush it to the disk; return a finding if the journal was repaired first.

    Raises:
        InputError: if a number is not finite, or the file cannot be written.
    """
    return append_samples(folder, [sample])


def append_samples(folder: str | Path, samples: Iterable[Sample]) -> Finding | None:
    """Append samples to the journal and flush them to the disk; return a finding if the journal was repaired first.

    A journal that ends in the middle of a line is truncated at its last newline.

    Raises:
        InputError: if a number is not finite, or the file cannot be written.
    """
    path = Path(folder) / FOLDER / FILE
    text = "".join(map(sample_line, samples))
    removed_line = append_durably(path, text, base_folder=Path(folder))
    what = "the journal is cut back to the line before it"
    return _truncation_finding(str(path), removed_line, what) if removed_line else None


def sample_line(sample: Sample) -> str:
    """JSON line of a sample, with its newline.

    Raises:
        InputError: if a number is not finite.
    """
    try:
        return json.dumps(sample_to_dict(sample, FOLDER), allow_nan=False) + "\n"
    except ValueError:
        raise InputError(f"sample {sample.sample} holds NaN or infinity; a recording holds finite numbers") from None


def _recording(text: bytes, path: str, folder: str | Path, cell: Cell) -> Recording:
    context = make_context(cell, path_resolver(str(folder), FOLDER))
    if text.count(b"\n") > MOST_SAMPLES:
        raise DatasetError(path, f"more than {MOST_SAMPLES} lines, expected one for each sample")
    *lines, tail = text.removeprefix(BOM).split(b"\n")
    samples: list[Sample] = []
    findings: list[Finding] = []
    dropped: list[DroppedSample] = []
    first_lines: dict[int, int] = {}
    if tail.strip() and not is_json(tail):
        cut = _truncation_finding(path, len(lines) + 1, "what is left of it is not read")
    else:
        cut, lines = None, [*lines, tail]
    for line_number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if len(line) > _LONGEST_LINE_BYTES:
            raise DatasetError(path, f"a line of {len(line)} bytes, no sample has that many", line_number)
        sample = sample_from_line(line, FileLine(path, line_number), context)
        number = sample.sample
        earlier = first_lines.setdefault(number, line_number)
        if earlier != line_number:
            what = f"{path}:{line_number}: sample {number} is dropped: line {earlier} has the same number."
            findings.append(Finding("dropped-sample", "info", (str(number),), what, ("Give it a new number.",)))
        elif isinstance(sample, DroppedSample):
            dropped.append(sample)
        else:
            samples.append(sample)
    findings += unknown_point_findings(dropped, path)
    check_image_bounds(samples, first_lines, path, cell)
    return Recording(tuple(samples), tuple(findings if cut is None else [*findings, cut]), str(folder))


def _truncation_finding(path: str, line: int, action: str) -> Finding:
    what = f"{path}:{line}: the last line was cut off while it was written."
    return Finding("dropped-sample", "info", (), what, why=f"{action[0].upper()}{action[1:]}.")


def check_image_bounds(samples: Sequence[Sample], lines: Mapping[int, int], path: str, cell: Cell) -> None:
    """Check that at least 95 % of each camera's pixels lie in its image.

    Args:
        samples: The samples read.
        lines: Line of each sample, by its number.
        path: The file of the samples.
        cell: The cell with the cameras.

    Raises:
        DatasetError: if they do not, with the first line that has a pixel outside and the likely cause.
    """
    for name, camera in cell.cameras.items():
        views = [
            (sample.sample, view)
            for sample in samples
            for view in sample.observations
            if isinstance(view, PixelObservation) and view.camera == name
        ]
        if camera.size_px is None or not views:
            continue
        pixels = np.concatenate([view.pixels for _, view in views])
        outside = ~_inside_mask(pixels, camera.size_px)
        if np.mean(outside) <= _OUTSIDE_SHARE:
            continue
        sample = next(n for n, s in views if not np.all(_inside_mask(s.pixels, camera.size_px)))
        width, height = camera.size_px
        share = f"{np.count_nonzero(outside)} of {len(pixels)} pixels of {name!r} lie outside its {width} x {height} px"
        raise FileLine(path, lines[sample]).error("observations", f"{share}{_likely_cause(camera, pixels)}")


def _inside_mask(pixels: Array, size_px: tuple[int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether pixels, (n, 2), lie in an image, (n,)."""
    margin = _MARGIN_SHARE * size_px[0]
    return np.asarray(np.all((pixels >= -margin) & (pixels <= np.array(size_px) - 1 + margin), -1))


def _likely_cause(camera: CellCamera, pixels: Array) -> str:
    """Likely cause of pixels outside the image, and how to fix it."""
    width, height = camera.size_px or (0, 0)
    u, v = np.max(pixels, axis=0)
    reach = f"; they reach to ({u:.0f}, {v:.0f})"
    if width == height or np.mean(_inside_mask(pixels, (height, width))) < 1 - _OUTSIDE_SHARE:
        return f"{reach}: size_px is of another resolution, give that of the images the points were found in"
    lens = None if camera.intrinsics is None else camera.intrinsics.camera
    middle = (np.array([width, height]) - 1) / 2
    if lens is not None and np.linalg.norm(lens.center - middle) < np.linalg.norm(lens.center - middle[::-1]):
        # The lens's principal point suits the size as stated.
        return (
            f"{reach}: u and v of the points look swapped, or width and height in both size_px and the camera matrix. "
            "u counts along the width"
        )
    return f"{reach}: width and height look swapped, expected size_px: [{height}, {width}]"


def unknown_point_findings(dropped_samples: Sequence[DroppedSample], path: str) -> list[Finding]:
    """Findings about samples dropped because of unknown or repeated point ids, one finding per target.

    Args:
        dropped_samples: The dropped samples, in the order of the file.
        path: The file of the samples.
    """
    by_target: dict[str, list[DroppedSample]] = {}
    for each in dropped_samples:
        by_target.setdefault(each.reason.target, []).append(each)
    findings = []
    for samples in by_target.values():
        first, others, known = samples[0], len(samples) - 1, samples[0].reason.known
        subject = f"sample {first.sample} and {others} more are" if others else f"sample {first.sample} is"
        ids = frozenset[int]().union(*(each.reason.ids for each in samples))
        from_one = (min(ids), max(ids)) == (min(known) + 1, max(known) + 1)
        do = (f"Subtract 1 from each id: they count from {min(known)}.",) if from_one else ()
        what = f"{path}:{first.line}: {subject} dropped: {first.reason}."
        findings.append(Finding("dropped-sample", "info", tuple(str(each.sample) for each in samples), what, do))
    return findings
