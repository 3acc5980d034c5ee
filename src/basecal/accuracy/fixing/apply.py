"""Application of a cure to the files of a cell, with backups of the originals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.fixing.change import Change
from basecal.accuracy.fixing.cures import Cure
from basecal.cell import Recording, RobotState, Sample
from basecal.cell.files import cell_from_dict, completed_cell_text, recording_from_text
from basecal.cell.format.originals import keep_originals
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_entry
from basecal.cell.journal.recording_file import FILE, FOLDER, sample_line
from basecal.errors import InputError
from basecal.fields.problems import Loc, field_name

_CELL = "cell.yaml"


def apply_cure(folder: Path, cure: Cure) -> Path:
    """Write the changes of a cure and return the folder with the original files.

    Args:
        folder: Folder of the cell.
        cure: The cure to apply.

    Raises:
        InputError: if the changed files would be invalid, the cure is already applied, or the files cannot be written.
            The files then stay unchanged.
    """
    change, path, journal = cure.change, folder / _CELL, folder / FOLDER / FILE
    text = old = read_text(path, "")
    if change.cell:
        text, _ = completed_cell_text(old, _nest_values(change.cell), str(path), change.cell.keys())
    changed_cell = cell_from_dict(parse_yaml(text, str(path)).data, str(path), folder)
    lines = None if change.samples is None else "".join(map(sample_line, change.samples))
    if lines is not None:
        recording_from_text(lines.encode(), folder, changed_cell)
    if text == old and (lines is None or lines.encode() == journal.read_bytes()):
        raise InputError(f"{path}: already contains this, nothing is changed: {cure.words}")
    note = {"code": cure.finding.code, "found": cure.finding.what, "done": cure.words}
    kept = keep_originals(folder, (path, journal), note)
    if text != old:
        write_atomically(path, text)
    if lines is not None:
        write_atomically(journal, lines, base_folder=folder)
    return kept


def describe_change(recording: Recording, change: Change) -> Iterator[str]:
    """Describe a change of the files, line by line.

    Args:
        recording: The recording as written.
        change: The change to describe.
    """
    for place, value in change.cell.items():
        yield f"cell.yaml: {yaml_entry(field_name(place), value)}"
    if change.samples is None:
        return
    before, after = ({sample.sample: sample for sample in samples} for samples in (recording.samples, change.samples))
    gone = sorted(before.keys() - after.keys())
    if gone:
        yield f"samples left out: {', '.join(map(str, gone))}"
    differing = [number for number in after if after[number] is not before[number]]
    if differing:
        yield f"samples changed: {len(differing)} of {len(before)}"
        yield from _example(before[differing[0]], after[differing[0]])


def _example(old: Sample, new: Sample) -> Iterator[str]:
    """Describe the changed robot states and images of one sample."""
    for name, state in new.robots.items():
        if name in old.robots and state is not old.robots[name]:
            yield f"sample {new.sample}, {name}: {_state_words(old.robots[name])} becomes {_state_words(state)}"
    if new.images != old.images:
        yield f"sample {new.sample}: {', '.join(new.images.values())} in place of {', '.join(old.images.values())}"


def _state_words(state: RobotState) -> str:
    if state.base_from_flange is not None:
        return repr(state.base_from_flange)
    joints = np.zeros(0) if state.joints_rad is None else state.joints_rad
    return "joints " + ", ".join(f"{value:.5g}" for value in joints)


def _nest_values(values: Mapping[Loc, Any]) -> dict[Any, Any]:
    """Nested mapping, as in `cell.yaml`, from values by location."""
    root: dict[str | int, Any] = {}
    for place, value in values.items():
        inner = root
        for key in place[:-1]:
            inner = inner.setdefault(key, {})
        inner[place[-1]] = value
    return root
