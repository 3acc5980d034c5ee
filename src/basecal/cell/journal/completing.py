"""Merging of additional data, recorded by another program, into the samples of an existing journal."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from basecal.bounded_file import read_bounded
from basecal.cell.format.paths import own_file
from basecal.cell.journal.recording_file import BOM, FILE, FOLDER, LARGEST_BYTES, sample_line
from basecal.cell.journal.sample_dict import sample_to_dict
from basecal.cell.journal.sample_line import line_data
from basecal.cell.journal.sample_values import FileLine
from basecal.cell.recording import Sample
from basecal.errors import DatasetError, InputError


def completed_recording_text(folder: str | Path, samples: Iterable[Sample], replace: bool = False) -> str:
    """Text of a cell's journal with samples merged into the lines of the same number, or appended.

    Lines without additions stay byte for byte the same; an incomplete last line is left out.

    Args:
        folder: The cell's folder.
        samples: Samples to merge.
        replace: Whether added data replace existing data of a line.

    Raises:
        DatasetError: if a line cannot be read.
        InputError: if a line already has a robot, an image or an observation to be added, and `replace` is False.
    """
    path = own_file(folder, f"{FOLDER}/{FILE}")
    text = read_bounded(path, LARGEST_BYTES).removeprefix(BOM) if path.exists() else b""
    unmatched = {sample.sample: sample for sample in samples}
    *complete_lines, tail = text.split(b"\n")
    lines = []
    for number, line in enumerate([*complete_lines, tail], start=1):
        file_line = FileLine(str(path), number)
        try:
            data = line_data(line, file_line) if line.strip() else None
        except DatasetError:
            if line is tail:
                continue
            raise
        if isinstance(data, dict) and (sample := unmatched.pop(data.get("sample", -1), None)) is not None:
            merged = _merge_data(data, sample_to_dict(sample, FOLDER), None if replace else file_line)
            lines.append(json.dumps(merged, allow_nan=False) + "\n")
        elif line.strip():
            lines.append(line.decode() + "\n")
    return "".join([*lines, *map(sample_line, unmatched.values())])


def _merge_data(data: dict[str, Any], addition: dict[str, Any], file_line: FileLine | None) -> dict[str, Any]:
    """Merge additional data into a line's data; an existing time stamp is kept.

    If `file_line` is None, added data replace existing data.
    """
    merged = {"stamp_s": addition["stamp_s"]} | data if "stamp_s" in addition else dict(data)
    for key in ("robots", "images", "background"):
        existing, added = merged.get(key, {}), addition.get(key, {})
        repeated = sorted(name for name in existing.keys() & added.keys() if existing[name] != added[name])
        if repeated and file_line is not None:
            raise _duplicate_error(file_line, f"{key}.{repeated[0]}")
        if key in addition:
            merged[key] = {**existing, **added}
    added_views = {_view_names(each) for each in addition.get("observations", [])}
    for observation in merged.get("observations", []):
        if _view_names(observation) in added_views and file_line is not None:
            raise _duplicate_error(file_line, f"observation of {' and '.join(_view_names(observation))}")
    if "observations" in addition:
        others = [each for each in merged.get("observations", []) if _view_names(each) not in added_views]
        merged["observations"] = [*others, *addition["observations"]]
    return {"sample": merged.pop("sample"), **merged}


def _view_names(observation: dict[str, Any]) -> tuple[str, ...]:
    """Names of camera and target, or of tip and mark, that identify an observation."""
    keys = ("camera", "target", "tip", "touch", "tip2", "clamp")
    return tuple(str(observation[key]) for key in keys if key in observation)


def _duplicate_error(file_line: FileLine, entry: str) -> InputError:
    return file_line.error(
        entry,
        "is recorded already and is not overwritten: add --session for other samples, or --replace for better ones",
    )
