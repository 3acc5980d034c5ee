"""Merging of cells that were recorded separately: equal names mean the same object, samples are renumbered."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

from basecal.cell import WORLD, Cell, Recording, Sample
from basecal.cell.files import (
    cell_from_dict,
    cell_to_dict,
    completed_cell_text,
    read_cell,
    read_recording,
    write_recording,
)
from basecal.cell.format.writing import stage_folder, write_new
from basecal.cell.format.yaml_text import parse_yaml, read_text
from basecal.errors import InputError
from basecal.exchange.importing.cell_files import numbered_path, place_files
from basecal.exchange.importing.image_names import read_image_names, write_image_names
from basecal.exchange.importing.pairing import plain_name

_LABELS = ("controller", "frames")  # fields of a robot that may be missing without a conflict
_SECTIONS = ("robots", "bases", "cameras", "targets")


@dataclass(frozen=True, eq=False)
class Part:
    """A cell to be merged: its folder, description and recording."""

    folder: Path
    cell: Cell
    recording: Recording


@dataclass(frozen=True, eq=False)
class Merged:
    """Result of a merge.

    Attributes:
        cell: The merged cell.
        recording: The merged recording.
        parts: The merged cells, in order.
        first_numbers: New number of each part's first sample.
    """

    cell: Cell
    recording: Recording
    parts: tuple[Part, ...]
    first_numbers: tuple[int, ...]


def merge_cells(folders: Sequence[Path], output: Path) -> Merged:
    """Merge several cells into a new one.

    Args:
        folders: Two or more cells; the text and the reference of the first are kept.
        output: Folder of the new cell.

    Raises:
        DatasetError: if a cell cannot be read.
        InputError: if the cells contradict each other, or the output exists.
    """
    parts = []
    for folder in folders:
        cell = read_cell(folder)
        parts.append(Part(folder, cell, read_recording(folder, cell)))
    text = _join_texts(parts)
    _check_times(parts)
    files: dict[str, Path] = {}
    samples: list[Sample] = []
    first_numbers = []
    names: dict[str, int] = {}
    for part in parts:
        _add_models(files, part)
        first = min((sample.sample for sample in part.recording.samples), default=None)
        # Numbers continue after those of the parts before.
        shift = max(sample.sample for sample in samples) + 1 - first if samples and first is not None else 0
        samples += _renumber_samples(part, shift, files)
        _add_image_names(names, part, shift)
        first_numbers.append(0 if first is None else first + shift)
    recording = Recording(tuple(samples), folder=str(output))
    with stage_folder(output) as staged:
        with place_files(files, staged):
            cell = cell_from_dict(parse_yaml(text, str(output / "cell.yaml")).data, str(output / "cell.yaml"), staged)
            write_new(staged / "cell.yaml", text)
            write_recording(recording, staged)
            if names:
                write_image_names(staged, names)
        _check_absent(staged, output)
    return Merged(cell, recording, tuple(parts), tuple(first_numbers))


def _check_absent(folder: Path, output: Path) -> None:
    """Check that no file of a folder exists in the output folder.

    Raises:
        InputError: if a file exists there.
    """
    for path in sorted(folder.rglob("*")):
        target = output / path.relative_to(folder)
        if path.is_file() and os.path.lexists(target):
            raise InputError(f"{target} exists and is not overwritten: choose another folder, or remove it first")


def _join_texts(parts: Sequence[Part]) -> str:
    """Text of the first `cell.yaml` with the entries that only the other cells have.

    Raises:
        InputError: if entries of the same name differ.
    """
    first, labels = parts[0], _robot_labels(parts)
    known = _entries(first, first, labels)
    text = read_text(first.folder / "cell.yaml", "")
    for part in parts[1:]:
        path = part.folder / "cell.yaml"
        data = parse_yaml(read_text(path, ""), str(path)).data
        added: dict[str, Any] = {}
        for (section, name), entry in _entries(part, first, labels).items():
            known_folder, known_entry = known.setdefault((section, name), (part.folder, entry[1]))
            if known_entry != entry[1]:
                raise InputError(_difference(f"{section}.{name}".rstrip("."), known_folder, known_entry, *entry))
            if known_folder == part.folder and name:
                new_entry = data[section][name] or {}
                keeps_guess = part.cell.reference == first.cell.reference or entry[1].get("on") != WORLD
                added.setdefault(section, {})[name] = new_entry if keeps_guess else _without_guess(new_entry)
        text = completed_cell_text(text, added, str(first.folder / "cell.yaml"))[0]
    return completed_cell_text(text, {"robots": labels}, str(first.folder / "cell.yaml"))[0] if labels else text


def _robot_labels(parts: Sequence[Part]) -> dict[str, dict[str, Any]]:
    """Labels by robot, from the first cell that states them."""
    labels: dict[str, dict[str, Any]] = {}
    for name, entry in (item for part in reversed(parts) for item in cell_to_dict(part.cell)["robots"].items()):
        if stated := {key: entry[key] for key in _LABELS if key in entry}:
            labels[name] = {**labels.get(name, {}), **stated}
    return labels


def _entries(part: Part, first: Part, labels: Mapping[str, dict[str, Any]]) -> dict[tuple[str, str], tuple[Path, Any]]:
    """Entries of a cell by section and name, and its noise, without guesses and free bases.

    Raises:
        InputError: if the cell has another reference than the first, and a pose is stated in its world.
    """
    data, is_other = cell_to_dict(part.cell), part.cell.reference != first.cell.reference
    found = {(section, name): entry for section in _SECTIONS for name, entry in (data.get(section) or {}).items()}
    found |= {("robots", name): {**labels.get(name, {}), **found["robots", name]} for name in part.cell.robots}
    for (section, name), entry in found.items():
        pose = entry if section == "bases" else entry.get("mount", {}) if entry.get("on") == WORLD else {}
        if is_other and pose.get("status", "free") != "free":
            raise InputError(
                f"{part.folder}: {section}.{name} is stated in the base of {part.cell.reference!r}. The reference "
                f"of {first.folder} is {first.cell.reference!r}: merge {part.folder} first, or make it free"
            )
    stated = {
        key: _without_guess(entry) for key, entry in found.items() if key[0] != "bases" or entry["status"] != "free"
    }
    return {key: (part.folder, entry) for key, entry in {**stated, ("noise", ""): data.get("noise")}.items()}


def _without_guess(entry: dict[str, Any]) -> dict[str, Any]:
    """Copy of an entry without the guess of a free mount."""
    is_free = entry.get("mount", {}).get("status") == "free"
    return {**entry, "mount": {"status": "free"}} if is_free else entry


def _difference(entry: str, first: Path, ours: Any, second: Path, theirs: Any) -> str:
    """Message about the first field in which two entries differ."""
    if isinstance(ours, dict) and isinstance(theirs, dict):
        key = next(key for key in {**ours, **theirs} if ours.get(key) != theirs.get(key))
        return _difference(f"{entry}.{key}", first, ours.get(key), second, theirs.get(key))
    states = f"{entry}: {first} states {_value_text(ours)}, {second} {_value_text(theirs)}"
    return f"{states}: give them other names, or correct the one that is wrong"


def _value_text(value: Any) -> str:
    return "nothing" if value is None else str(value)


def _check_times(parts: Sequence[Part]) -> None:
    """Check that streams do not overlap in time, because robots and images on separate lines are joined by time.

    Raises:
        InputError: if recordings overlap and one of them is a stream.
    """
    spans = []
    for part in parts:
        stamps = [s.stamp_s for s in part.recording.samples if s.stamp_s is not None]
        is_stream = any(bool(s.robots) != bool(s.observations or s.images) for s in part.recording.samples)
        if stamps:
            spans.append((min(stamps), max(stamps), is_stream, part.folder))
    spans.sort(key=lambda span: span[0])
    for (_, end, is_stream, folder), (start, other_end, is_other_stream, other) in combinations(spans, 2):
        if start <= end and (is_stream or is_other_stream):
            raise InputError(
                f"{folder} and {other} overlap in time ({start:g} to {min(end, other_end):g} s). Their robots and "
                "images are on separate lines, which are joined by time: shift the times of one of them"
            )


def _add_models(files: dict[str, Path], part: Part) -> None:
    """Add the URDFs of a part to `files`, by their path in the new cell.

    Raises:
        InputError: if a different URDF has the same path.
    """
    for robot in part.cell.robots.values():
        if robot.urdf is None:
            continue
        source = part.folder / robot.urdf
        earlier = files.setdefault(robot.urdf, source)
        if earlier.read_bytes() != source.read_bytes():
            raise InputError(f"{earlier} and {source} differ, and would be one file: rename one, in its cell.yaml too")


def _renumber_samples(part: Part, shift: int, files: dict[str, Path]) -> list[Sample]:
    """Renumber the samples of a part and add their images to `files`, renamed if a path is taken."""
    renumbered = []
    for sample in part.recording.samples:
        number = sample.sample + shift
        images, background = (
            {camera: _image(part, path, number, files) for camera, path in paths.items()}
            for paths in (sample.images, sample.background)
        )
        renumbered.append(replace(sample, sample=number, images=images, background=background))
    return renumbered


def _add_image_names(names: dict[str, int], part: Part, shift: int) -> None:
    """Add the new sample numbers of the images that a part's tables name and that are not recorded yet.

    Raises:
        InputError: if an image of this name is expected for a sample of another part.
    """
    recorded = {plain_name(path) for sample in part.recording.samples for path in sample.images.values()}
    for name, number in read_image_names(part.folder).items():
        if name in recorded:
            continue
        if name in names:
            raise InputError(
                f"{part.folder}: its tables name image {name!r}, as those of another cell do. Import the images "
                "into each cell before the merge"
            )
        names[name] = number + shift


def _image(part: Part, path: str, number: int, files: dict[str, Path]) -> str:
    """Path of an image in the new cell; a missing image keeps its path and is reported later."""
    source = part.folder / path
    if not source.is_file():
        return path
    while files.setdefault(path, source) != source:
        path = numbered_path(path, number)
    return path
