"""`basecal target`."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from basecal.cell.targets.registry import TargetKindName
from basecal.cli.terminal import say
from basecal.errors import InputError
from basecal.exchange.importing.described_target import printed_fields

if TYPE_CHECKING:
    from basecal.cell import Target


def target(
    out: Path,
    /,
    *,
    cell: Path | None = None,
    name: str | None = None,
    kind: TargetKindName = "charuco",
    columns: int = 5,
    rows: int = 7,
    square_mm: float = 40.0,
    marker_mm: float | None = None,
    dictionary: str | None = None,
    family: str = "tag36h11",
    tag: int = 0,
    field: Annotated[tuple[str, ...], Parameter(name="--set", negative=())] = (),
) -> int:
    """Print a target at true scale, with a ruler to check the print.

    Writes OUT, a .pdf or .svg, and shows the lines for cell.yaml that describe
    it. A light (led) gives a template with a cross where it goes.

    For example:

        basecal target board.pdf --kind charuco --columns 5 --rows 7 --square-mm 40
        basecal target tag.svg --kind apriltag --tag 3 --square-mm 80
        basecal target board.pdf --cell mycell --name board

    Args:
        out: File to write.
        cell: A cell whose target is printed, instead of the options below.
        name: Which target of the cell; needless where it has one.
        kind: What to print.
        columns: Columns of squares (charuco), inner corners (chessboard) or circles.
        rows: Rows of them.
        square_mm: Size of a square or tag, spacing of circles.
        marker_mm: Size of a ChArUco marker; three quarters of the square where not given.
        dictionary: Of the ChArUco markers; of DICT_4X4 the smallest that has enough where not given.
        family: Of the AprilTag.
        tag: Number of the AprilTag.
        field: FIELD=VALUE as in cell.yaml, such as legacy_pattern=true; may be given several times.
    """
    from basecal.cell.targets.fiducials import smallest_dictionary
    from basecal.cell.targets.kind import PrintSizes
    from basecal.reporting.printed import printed_pages, write_pages

    if cell is not None:
        title, shape = _cell_target(cell, name)
    else:
        square, marker = square_mm / 1e3, (0.75 * square_mm if marker_mm is None else marker_mm) / 1e3
        markers = dictionary or smallest_dictionary("DICT_4X4_50", columns * rows // 2)
        sizes = PrintSizes(columns, rows, round(square, 9), round(marker, 9), markers, family, tag)
        fields = printed_fields(kind, sizes, field)
        title, shape = _describe_target(kind, fields)
    pages = printed_pages(shape, title)
    for path in write_pages(pages, out):
        say(f"wrote {path} ({pages[0].paper}): print at 100 % and measure the ruler")
    if cell is None:
        say(f"\nfor cell.yaml, under targets:\n  board:\n    on: hand\n    mount: {{status: free}}\n    kind: {kind}")
        for key, value in fields.items():
            say(f"    {key}: {value if isinstance(value, str) else dumps(value)}")
    return 0


def _describe_target(kind: str, fields: dict[str, Any]) -> tuple[str, Target]:
    """The target as a cell.yaml with these fields describes it, checked as one."""
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
    options = ", ".join(f"{key} {value}" for key, value in fields.items())
    return f"{kind}: {options}" if options else kind, shape


def _cell_target(folder: Path, name: str | None) -> tuple[str, Target]:
    from basecal.cell.files import read_cell
    from basecal.errors import FrameNotFound

    targets = {n: t.target for n, t in read_cell(folder).targets.items() if t.target is not None}
    if name is None and len(targets) != 1:
        raise InputError(f"{folder} has {len(targets)} targets: say which with --name ({', '.join(targets) or 'none'})")
    chosen = name or next(iter(targets))
    if chosen not in targets:
        raise FrameNotFound(chosen, list(targets))
    shape = targets[chosen]
    options = ", ".join(f"{k} {v}" for k, v in shape.options.items() if not isinstance(v, list) or len(v) == 2)
    return f"{chosen}: {shape.kind}, {options}", shape
