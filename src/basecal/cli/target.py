"""`basecal target`."""

from __future__ import annotations

from dataclasses import replace
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from basecal.cell.targets.registry import TargetKindName
from basecal.cli.terminal import say
from basecal.errors import InputError
from basecal.exchange.importing.described_target import MARKER_SHARE, print_sizes, printed_fields

if TYPE_CHECKING:
    from collections.abc import Mapping

    from basecal.cell import Target
    from basecal.cell.targets.kind import PrintSizes

_SQUARE_MM = 40.0  # of the layout of a target before it is scaled, and of templates
_PAPER_NAMES = {"letter": "letter", **{name.lower(): name for name in ("A4", "A3", "A2", "A1", "A0")}}


def target(
    out: Path,
    /,
    *,
    cell: Path | None = None,
    name: str | None = None,
    kind: TargetKindName = "charuco",
    columns: int = 5,
    rows: int = 7,
    square_mm: float | None = None,
    paper: Literal["a4", "letter", "a3", "a2", "a1", "a0"] | None = None,
    marker_mm: float | None = None,
    dictionary: str | None = None,
    family: str = "tag36h11",
    tag: int = 0,
    field: Annotated[tuple[str, ...], Parameter(name="--set", negative=())] = (),
) -> int:
    """Print a target at true scale, with rulers to check the print.

    Writes OUT, a .pdf or .svg, and prints the lines for cell.yaml that describe
    it. The sheet also has two rulers, dimensions to check, the target's axes at
    its origin, and cut marks. Squares are as large as the paper allows unless
    --square-mm is given. For an LED (led) it is a template with a cross.

    For example:

        basecal target board.pdf --paper letter
        basecal target board.pdf --kind charuco --columns 5 --rows 7 --square-mm 40
        basecal target tag.svg --kind apriltag --tag 3 --square-mm 80
        basecal target board.pdf --cell mycell --name board

    Args:
        out: File to write.
        cell: A cell whose target is printed, instead of the options below.
        name: Name of the target in the cell; needed if it has several.
        kind: Kind of target.
        columns: Columns of squares (charuco), inner corners (chessboard) or circles.
        rows: Rows of squares (charuco), inner corners (chessboard) or circles.
        square_mm: Size of a square or tag, spacing of circles; by default the largest integer that fits.
        paper: Paper size; by default a4, or with --square-mm the smallest that fits.
        marker_mm: Size of a ChArUco marker; three quarters of the square by default.
        dictionary: Dictionary of the ChArUco markers; by default the smallest of DICT_4X4 with enough markers.
        family: Family of the AprilTag.
        tag: Number of the AprilTag.
        field: FIELD=VALUE as in cell.yaml, such as legacy_pattern=true; may be given several times.
    """
    from basecal.reporting.target_sheet import printed_pages, write_pages

    if cell is not None:
        title, shape = _cell_target(cell, name)
    else:
        square_m = (_SQUARE_MM if square_mm is None else square_mm) / 1e3
        marker_m = None if marker_mm is None else marker_mm / 1e3
        sizes = print_sizes(columns, rows, square_m, marker_m, dictionary, family, tag)
        fitted_paper = None if square_mm is not None else _PAPER_NAMES[paper or "a4"]
        fields, shape = _sized_target(kind, sizes, field, fitted_paper, marker_mm is None)
        title = ", ".join([kind, *option_words(fields)])
    pages = printed_pages(shape, title, None if paper is None else _PAPER_NAMES[paper])
    for path in write_pages(pages, out):
        say(f"wrote {path} ({pages[0].paper}): print at 100 % and measure both rulers")
    if cell is None:
        say(f"\nfor cell.yaml, under targets:\n  board:\n    on: hand\n    mount: {{status: free}}\n    kind: {kind}")
        for key, value in fields.items():
            say(f"    {key}: {value if isinstance(value, str) else dumps(value)}")
    return 0


def _sized_target(
    kind: str, sizes: PrintSizes, field: tuple[str, ...], fitted_paper: str | None, scales_marker: bool
) -> tuple[dict[str, Any], Target]:
    """Fields of cell.yaml and the target that they describe, with the given sizes or the largest that fit a paper."""
    from basecal.reporting.target_sheet import largest_pitch_mm

    fields = printed_fields(kind, sizes, field)
    shape = _described_target(kind, fields)
    if fitted_paper is None or not shape.sheets:
        return fields, shape
    square_m = round(largest_pitch_mm(shape, fitted_paper) / 1e3, 9)
    marker_m = round(MARKER_SHARE * square_m, 9) if scales_marker else sizes.marker_m
    return _sized_target(kind, replace(sizes, square_m=square_m, marker_m=marker_m), field, None, scales_marker)


def option_words(options: Mapping[str, Any]) -> list[str]:
    """Fields of a target as text, such as `squares 5 x 7` and `square 36 mm`; lists of more than two are left out."""
    words = []
    for key, value in options.items():
        if isinstance(value, list):
            words += [f"{key} {value[0]} x {value[1]}"] if len(value) == 2 else []
        elif key.endswith("_m"):
            words.append(f"{key[:-2]} {round(1e3 * value, 6):g} mm")
        else:
            words.append(f"{key.replace('_', ' ')} {value}")
    return words


def _described_target(kind: str, fields: dict[str, Any]) -> Target:
    """The target that a cell.yaml with these fields describes, with the same checks."""
    from basecal.cell.files import cell_from_dict

    described = cell_from_dict(
        {
            "schema": "basecal/cell/1",
            "reference": "arm",
            "robots": {"arm": {}},
            "cameras": {"camera": {"on": "arm"}},
            "targets": {"target": {"on": "world", "kind": kind, **fields}},
        },
        path="options",
    )
    shape = described.targets["target"].target
    if shape is None:
        raise InputError(f"a target of kind {kind!r} has no points to print")
    return shape


def _cell_target(folder: Path, name: str | None) -> tuple[str, Target]:
    from basecal.cell.files import read_cell
    from basecal.errors import FrameNotFound

    targets = {n: t.target for n, t in read_cell(folder).targets.items() if t.target is not None}
    if not targets:
        raise InputError(f"{folder}/cell.yaml describes no target to print: leave --cell out to choose one")
    if name is None and len(targets) != 1:
        raise InputError(f"{folder} has {len(targets)} targets: say which with --name ({', '.join(targets)})")
    chosen = name or next(iter(targets))
    if chosen not in targets:
        raise FrameNotFound(chosen, list(targets))
    shape = targets[chosen]
    return ", ".join([f"{chosen}: {shape.kind}", *option_words(shape.options)]), shape
