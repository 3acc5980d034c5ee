"""Description of a target by options: its kind, counts and sizes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from basecal.cell import WORLD
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.target import Target
from basecal.cell.targets.fiducials import smallest_dictionary
from basecal.cell.targets.kind import PrintSizes, is_indistinguishable
from basecal.cell.targets.registry import TARGETS
from basecal.errors import InputError, UsageError, list_names
from basecal.exchange.importing.imported import KnownCell, ViewNames, carried_entry, known_cell
from basecal.fields.typed_length import columns_rows, length_m

_COUNT_FIELDS = ("squares", "corners", "circles", "tags")  # fields that hold columns and rows
MARKER_SHARE = 0.75  # default size of a marker as a share of the square


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The shape of a target.

    Attributes:
        squares: Columns and rows of a ChArUco board, such as 5x7.
        corners: Columns and rows of a chessboard's inner corners, such as 8x6.
        circles: Columns and rows of circles.
        tags: Columns and rows of an aprilgrid's tags.
        square: Size of a square or tag, spacing of circles, with its unit, such as 40mm.
        marker: Size of a ChArUco marker; by default three quarters of the square.
        dictionary: Dictionary of the ChArUco markers.
        family: Family of the AprilTags.
        tag: Number of a single AprilTag.
        set: FIELD=VALUE as in cell.yaml, such as legacy_pattern=true; may be given several times.
    """

    squares: str | None = None
    corners: str | None = None
    circles: str | None = None
    tags: str | None = None
    square: str | None = None
    marker: str | None = None
    dictionary: str | None = None
    family: str | None = None
    tag: int | None = None
    set: tuple[str, ...] = ()


UNSTATED_SHAPE = Shape()
"""Shape without any stated value."""


def target_fields(kind: str, shape: Shape) -> dict[str, Any]:
    """Fields of a target in `cell.yaml`, including its kind.

    Raises:
        InputError: if counts or a size are missing, or do not apply to the kind.
    """
    if kind not in TARGETS:
        raise InputError(f"target {kind!r}: expected one of {list_names(list(TARGETS))}")
    counts = {name: text for name in _COUNT_FIELDS if (text := getattr(shape, name)) is not None}
    numbers = [columns_rows(text, f"--{name}") for name, text in counts.items()]
    columns, rows = numbers[0] if numbers else (1, 1)
    square_m = 1.0 if shape.square is None else length_m(shape.square, "--square", "40mm")
    marker_m = None if shape.marker is None else length_m(shape.marker, "--marker", "30mm")
    family, tag = shape.family or "tag36h11", shape.tag or 0
    sizes = print_sizes(columns, rows, square_m, marker_m, shape.dictionary, family, tag)
    fields = printed_fields(kind, sizes, shape.set)
    _check_description(kind, shape, fields, list(counts))
    return {"kind": kind, **fields}


def print_sizes(
    columns: int, rows: int, square_m: float, marker_m: float | None, dictionary: str | None, family: str, tag: int
) -> PrintSizes:
    """Sizes of a target to print, with defaults for the marker's size and dictionary."""
    marker_m = MARKER_SHARE * square_m if marker_m is None else marker_m
    dictionary = dictionary or smallest_dictionary("DICT_4X4_50", columns * rows // 2)
    return PrintSizes(columns, rows, round(square_m, 9), round(marker_m, 9), dictionary, family, tag)


def target_entry(
    folder: str | Path,
    kind: str | None,
    shape: Shape,
    names: ViewNames,
) -> dict[str, Any]:
    """Entry of `cell.yaml` for a target in images; empty if no target is described.

    Args:
        folder: Folder of the cell, or of a new cell.
        kind: Kind of the target; None if no target is described.
        shape: Counts and sizes of the target.
        names: Names of camera and target, and their carriers if stated.

    Raises:
        UsageError: if a target is described without its kind.
        InputError: if sizes are missing, the carrier is ambiguous, or images cannot distinguish it from another target.
    """
    if not isinstance(shape, Shape):
        raise InputError(f"shape is {shape!r}, expected a basecal.Shape, such as Shape(squares='5x7', square='40mm')")
    if kind is None:
        if names.target_on is not None or shape != UNSTATED_SHAPE:
            raise UsageError("a target is described, but not its kind: add --target charuco, or another kind")
        return {}
    fields = target_fields(kind, shape)
    cell = known_cell(folder)
    _check_marks(cell, names.target, kind, fields)
    return carried_entry("targets", names.target, names.target_on or _single_carrier(cell, names), **fields)


def are_indistinguishable(first: Target, second: Target) -> bool:
    """Whether images cannot distinguish two targets."""
    return first.kind == second.kind and is_indistinguishable(TARGETS[first.kind], first.options, second.options)


def _check_marks(cell: KnownCell, name: str, kind: str, fields: Mapping[str, Any]) -> None:
    """Check that images can distinguish a target from the cell's other targets.

    Raises:
        InputError: if they cannot.
    """
    target_kind = TARGETS[kind]
    for other in cell.targets.values():
        if other.name == name or other.target is None or other.target.kind != kind or not target_kind.marks(fields):
            continue
        if is_indistinguishable(target_kind, fields, other.target.options):
            raise InputError(
                f"no image distinguishes {name!r} from {other.name!r} of cell.yaml, which has the same marks. If "
                "they are one target, omit --target. Otherwise state its own dictionary, family, number or counts"
            )


def _single_carrier(cell: KnownCell, names: ViewNames) -> str:
    """The only robot that does not carry the camera, or the world if there is none.

    Raises:
        InputError: if there are several such robots, or the cell has no robots yet.
    """
    if not cell.robots:
        raise InputError(f"give the carrier of the target {names.target!r}: --target-on ROBOT or --target-on world")
    carrier = names.camera_on or cell.cameras[names.camera].on
    others = [robot for robot in cell.robots if robot != carrier]
    if len(others) > 1 or (not others and carrier == WORLD):
        options = " or ".join(f"--target-on {each}" for each in (*others, WORLD) if each != carrier)
        raise InputError(f"give the carrier of the target {names.target!r}: {options}")
    return others[0] if others else WORLD


def _check_description(kind: str, shape: Shape, fields: dict[str, Any], counts: list[str]) -> None:
    """Check that the required counts and sizes of the kind are stated, and no other counts.

    Raises:
        InputError: if they are not.
    """
    set_names = {each.partition("=")[0] for each in shape.set}
    needed = [name for name in _COUNT_FIELDS if name in fields and not isinstance(fields[name][0], dict)]
    has_size = bool(fields.keys() - {"dictionary", "family"})
    if missing := [f"--{name} COLUMNSxROWS" for name in needed if name not in {*counts, *set_names}]:
        missing = [*missing, *(["--square SIZE"] if shape.square is None else [])]
    elif has_size and shape.square is None and not any(name.endswith("_m") for name in set_names):
        missing = ["--square SIZE"]
    if missing:
        raise InputError(f"a target of kind {kind!r} needs {' and '.join(missing)}, such as 5x7 and 40mm; measure it")
    if odd := [name for name in counts if name not in needed]:
        counted = f"counted by --{needed[0]}" if needed else "not counted"
        raise InputError(f"a target of kind {kind!r} is {counted}, not by --{odd[0]}")


def printed_fields(kind: str, sizes: PrintSizes, field_words: tuple[str, ...]) -> dict[str, Any]:
    """Fields of a target in `cell.yaml` from its sizes, with additional fields FIELD=VALUE.

    Raises:
        InputError: if sizes do not describe the kind, or an additional field is not FIELD=VALUE.
    """
    printed = TARGETS[kind].printed
    if printed is None:
        raise InputError(f"a target of kind {kind!r} needs more than sizes: describe it in cell.yaml")
    fields = dict(printed(sizes))
    for each in field_words:
        name, equals, value = each.partition("=")
        if not equals:
            raise InputError(f"--set takes FIELD=VALUE, such as legacy_pattern=true, got {each!r}")
        fields |= parse_yaml(f"{name}: {value}", "--set").data
    return fields
