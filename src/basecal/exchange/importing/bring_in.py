"""Import into a cell's folder: all data are read, paired and checked before anything is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as dataclass_replace
from itertools import count
from pathlib import Path
from typing import Any

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, Recording, Sample
from basecal.cell.files import (
    cell_from_dict,
    completed_cell_text,
    completed_recording_text,
    read_recording,
    recording_from_text,
)
from basecal.cell.format.originals import keep_originals
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text
from basecal.errors import DatasetError, InputError
from basecal.exchange.importing.cell_files import numbered_path, place_files
from basecal.exchange.importing.image_names import read_image_names, write_image_names
from basecal.exchange.importing.imported import Imported, Row
from basecal.exchange.importing.pairing import Pairing, is_same_state, pair, plain_name, samples_without_content
from basecal.fields.problems import Loc

_CELL, _FOLDER = "cell.yaml", "recording"
_REST_TOLERANCE = 2e-3  # [m, rad] largest spread of poses of an arm at rest, with the rounding of `tf2_echo`


@dataclass(frozen=True, eq=False)
class ImportResult:
    """Result of an import.

    Attributes:
        cell: The cell after the import.
        recording: The recording after the import.
        pairing: Assignment of rows to samples; empty without rows.
        made: Number of new samples.
        changed: Names of the new or changed fields of `cell.yaml`.
        is_new_cell: Whether the cell is new.
        doubts: Implausible parts of the input, and samples that will not be used, one line each; they were imported
            nevertheless.
    """

    cell: Cell
    recording: Recording
    pairing: Pairing
    made: int
    changed: tuple[str, ...]
    is_new_cell: bool
    doubts: tuple[str, ...] = ()


def add_to_cell(
    folder: Path,
    imports: Imported,
    check: Callable[[Cell, Recording], tuple[str, ...]],
    replace: bool = False,
) -> ImportResult:
    """Add imported rows to a cell, all or none.

    Args:
        folder: Folder of the cell, or of a new cell.
        imports: The imported data.
        check: Function from the cell and the additions to texts about implausible data; raises InputError to prevent
            writing.
        replace: Whether to replace existing data, after a backup in `originals`.

    Raises:
        InputError: if the data are inconsistent with the existing data, or would overwrite them.
    """
    path, journal_path = folder / _CELL, folder / _FOLDER / "samples.jsonl"
    old = read_text(path, "") if path.exists() else None
    started = imports.new_cell if old is None else old
    added = {**_reference_entry(imports.cell), **imports.cell} if started is None else imports.cell
    if started is not None and not replace:
        added = _omit_defaults(added, imports.defaults, parse_yaml(started, str(path)).data)
    with place_files(imports.files, folder):
        replaced = imports.defaults.union(imports.replaced, _locations(added)) if replace else imports.replaced
        text, changed = completed_cell_text(started, added, str(path), replaced)
        cell = cell_from_dict(parse_yaml(text, str(path)).data, str(path), folder)
        recorded = read_recording(folder, cell) if journal_path.exists() else Recording(folder=str(folder))
        imports = _repeat_row(imports, recorded) if imports.is_still else imports
        imports = _separate_repeated_views(imports, recorded)
        if not (replace or imports.by) and recorded.samples and len(imports.rows) != len(recorded.samples):
            imports = dataclass_replace(imports, is_session=imports.is_session or _is_whole(imports.rows, cell))
        names = read_image_names(folder)
        pairing = pair(imports, recorded.samples, names, replace) if imports.rows else Pairing("order", ())
        samples_by_path = {path: sample.sample for sample in recorded.samples for path in sample.images.values()}
        samples, image_files = _additions(imports.rows, pairing, samples_by_path)
        journal = completed_recording_text(folder, samples, replace) if samples else ""
        recording = _checked_recording(journal, folder, cell, imports.source) if samples else recorded
        doubts = (*check(cell, Recording(tuple(samples))), *_new_findings(recording, recorded))
        with place_files(image_files, folder, imports.is_linked):
            if replace and old is not None:
                keep_originals(folder, (path, journal_path), {"done": f"import --replace of {imports.source}"})
            if text != old:
                write_atomically(path, text)
            named = {**names, **_named_samples(imports.rows, pairing, samples)}
            if named != names:
                write_image_names(folder, named)
            if samples:
                write_atomically(journal_path, journal, base_folder=folder)
    made = len({sample.sample for sample in samples} - {sample.sample for sample in recorded.samples})
    return ImportResult(cell, recording, pairing, made, changed, old is None, doubts)


def _checked_recording(journal: str, folder: Path, cell: Cell, source: str) -> Recording:
    """Recording of a journal before it is written; errors are about the source of what is added."""
    try:
        return recording_from_text(journal.encode(), folder, cell)
    except DatasetError as error:
        raise DatasetError(source, error.reason, field=error.field) from None


def _new_findings(recording: Recording, earlier: Recording) -> list[str]:
    """Messages about samples of a recording that will not be used."""
    return [finding.message for finding in recording.findings if finding not in earlier.findings]


def _reference_entry(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Field `reference` of a new cell: its first robot; empty if it has none."""
    first = next(iter(cell.get("robots", {})), None)
    return {} if first is None else {"reference": first}


def _omit_defaults(new: Mapping[str, Any], defaults: frozenset[Loc], old: Any, parent: Loc = ()) -> dict[str, Any]:
    """New content without the defaults for which the old content has a value."""
    kept = {}
    for key, value in new.items():
        other = old.get(key) if isinstance(old, Mapping) else None
        if isinstance(value, Mapping) and (*parent, key) not in defaults:
            kept[key] = _omit_defaults(value, defaults, other, (*parent, key))
        elif other is None or (*parent, key) not in defaults:
            kept[key] = value
    return kept


def _repeat_row(imports: Imported, recording: Recording) -> Imported:
    """A copy of an import of an arm at rest, with its pose repeated for each recorded sample that lacks it.

    Raises:
        InputError: if the rows differ, or nothing is recorded.
    """
    if not recording.samples:
        raise InputError(f"{imports.source}: --still is for an arm at rest: import the moving robots and cameras first")
    first = imports.rows[0].robots
    for row in imports.rows:
        if not all(is_same_state(state, first[name], _REST_TOLERANCE) for name, state in row.robots.items()):
            count = len(imports.rows)
            raise InputError(f"{imports.source}: holds {count} rows that differ: --still is for an arm at rest")
    waiting = samples_without_content(imports.rows, recording.samples) or recording.samples
    rows = tuple(dataclass_replace(imports.rows[0], sample=sample.sample) for sample in waiting)
    return dataclass_replace(imports, rows=rows, by="sample")


def _separate_repeated_views(imports: Imported, recording: Recording) -> Imported:
    """A copy in which further views of a sample become new samples with the same robot states."""
    if not all(row.sample is not None and row.observations and not row.robots for row in imports.rows):
        return imports
    known: dict[int | None, Sample] = {sample.sample: sample for sample in recording.samples}
    numbers = (*(sample.sample for sample in recording.samples), *(row.sample or 0 for row in imports.rows))
    new_numbers = count(max(numbers, default=-1) + 1)
    used: set[int | None] = set()
    rows = []
    for row in imports.rows:
        first = known.get(row.sample) if row.sample in used else None
        used.add(row.sample)
        rows.append(row if first is None else dataclass_replace(row, sample=next(new_numbers), robots=first.robots))
    return dataclass_replace(imports, rows=tuple(rows))


def _is_whole(rows: Sequence[Row], cell: Cell) -> bool:
    """Whether each row has views and the robots that carry their cameras and targets."""
    things: dict[str, CellCamera | CellTarget] = {**cell.cameras, **cell.targets}
    carriers = [
        {things[name].on for o in row.observations for name in (o.camera, o.target) if name in things} for row in rows
    ]
    return all(each and each - {WORLD} <= row.robots.keys() for each, row in zip(carriers, rows, strict=True))


def _locations(data: Mapping[str, Any], parent: Loc = ()) -> Iterator[Loc]:
    """Locations of all values, with mappings such as a pose or a lens as one value."""
    for key, value in data.items():
        if isinstance(value, Mapping) and not {"status", "kind"} & value.keys():
            yield from _locations(value, (*parent, key))
        elif isinstance(value, Mapping) and "kind" in value:
            yield from ((*parent, key, inner) for inner in value)
        else:
            yield (*parent, key)


def _named_samples(rows: tuple[Row, ...], pairing: Pairing, samples: Sequence[Sample]) -> Mapping[str, int]:
    """Sample numbers by name of images that rows name but that are not recorded under these names."""
    kept = {plain_name(path) for sample in samples for path in sample.images.values()}
    return {
        plain_name(row.image): number
        for row, number in zip(rows, pairing.numbers, strict=True)
        if row.image is not None and number is not None and plain_name(row.image) not in kept
    }


def _additions(
    rows: tuple[Row, ...], pairing: Pairing, samples_by_path: Mapping[str, int]
) -> tuple[list[Sample], dict[str, Path]]:
    """Additions to each sample, and the new images by unique path in the cell."""
    samples: list[Sample] = []
    image_files: dict[str, Path] = {}
    for row, number in zip(rows, pairing.numbers, strict=True):
        if number is None:
            continue
        images: dict[str, Any] = {}
        for camera, source in row.images.items():
            path = f"{_FOLDER}/images/{camera}/{source.name}"
            while samples_by_path.get(path, number) != number or image_files.get(path, source) != source:
                path = numbered_path(path, number)
            images[camera], image_files[path] = path, source
        samples.append(Sample(number, row.stamp_s, row.robots, row.observations, images))
    return samples, image_files
