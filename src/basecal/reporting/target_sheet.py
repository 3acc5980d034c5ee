"""A target on paper at true scale, as SVG and PDF, with rulers both ways, sizes, axes and cut marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.cell import Target
from basecal.cell.format.writing import write_output
from basecal.cell.sheet import Sheet
from basecal.errors import InputError
from basecal.geometry import Array
from basecal.reporting import pdf
from basecal.reporting.templates.environment import fill_part
from basecal.vision.draw.drawing import target_drawing

_PAPERS = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
LETTER = {"letter": (215.9, 279.4)}
_MARGIN_MM = 8.0
_FOOT_MM = 22.0  # below the target, for a ruler and words
_SIDE_MM = 14.0  # right of it, for a ruler
_MARK_MM = 4.0  # length of cut marks
_OFF_MM = 1.5  # between the target and what is drawn beside it
_AXIS_MM = 10.0
_RULER_MM = 100.0
_LIGHT_MM = 5.0
_CROSS_MM = 8.0
_LINE_MM = 0.15
_TEXT_MM = 3.2  # height of its letters with what hangs below the line


@dataclass(frozen=True, eq=False)
class PrintedPage:
    """Black shapes on one sheet of paper, in mm from its top left corner.

    Attributes:
        paper: Its name, or `custom`.
        size_mm: Width and height.
        rectangles: Left, top, right, bottom, (n, 4).
        discs: Centre x, y and radius, (n, 3).
        rings: Likewise, drawn as thin lines.
        lines: From x, y to x, y, (n, 4), thin.
        texts: x, y of the baseline's left end, and what it says.
    """

    paper: str
    size_mm: tuple[float, float]
    rectangles: Array
    discs: Array
    rings: Array
    lines: Array
    texts: tuple[tuple[float, float, str], ...]


def printed_pages(target: Target, title: str, paper: str | None = None) -> list[PrintedPage]:
    """Every sheet of a target with what checks the print.

    Args:
        target: What is printed; for lights and points a template with crosses is drawn.
        title: Printed above the ruler.
        paper: Such as `A4` or `letter`; the smallest that holds the sheet where None.

    Raises:
        InputError: if the paper is too small, or a template is requested of points off the plane z = 0.
    """
    if not target.sheets:
        return [_template(target, title, paper)]
    pages = []
    for sheet in target_drawing(target):
        left, top, right, bottom = 1e3 * sheet.paper
        name, size = _suitable_paper(right - left, bottom - top, paper)
        shift = np.array([(size[0] - _SIDE_MM - right - left) / 2, (size[1] - _FOOT_MM - bottom - top) / 2])
        discs = 1e3 * sheet.discs
        discs[:, :2] += shift
        rectangles = 1e3 * sheet.rectangles + np.tile(shift, 2)
        part = next((key for key, value in target.options.items() if value == sheet.pitch), "size_m")
        check = f"between the cut marks {right - left:g} x {bottom - top:g} mm; {part[:-2]} {1e3 * sheet.pitch:g} mm"
        rulers, texts = _rulers(size, title, check)
        axes, names = _axes(sheet, shift)
        lines = np.concatenate([rulers, _cut_marks(1e3 * sheet.paper + np.tile(shift, 2)), axes])
        pages.append(PrintedPage(name, size, rectangles, discs, np.zeros((0, 3)), lines, (*texts, *names)))
    return pages


def largest_pitch_mm(target: Target, paper: str) -> float:
    """The largest whole pitch at which all sheets of a target fit on a paper; its layout is scaled as a whole.

    Args:
        target: Of any pitch.
        paper: Such as `A4` or `letter`.
    """
    scales = []
    for sheet in target.sheets:
        width, height = 1e3 * (sheet.paper[2:] - sheet.paper[:2])
        rooms = [(a - 2 * _MARGIN_MM - _SIDE_MM, b - 2 * _MARGIN_MM - _FOOT_MM) for a, b in _orientations(paper)]
        scales.append(1e3 * sheet.pitch * max(min(a / width, b / height) for a, b in rooms))
    return float(np.floor(min(scales) + 1e-9))


def write_pages(pages: Sequence[PrintedPage], path: Path) -> list[Path]:
    """Write pages as `.pdf`, one file, or `.svg`, one file a page; the files written.

    Raises:
        InputError: if the name ends otherwise, or it cannot be written.
    """
    if path.suffix == ".pdf":
        drawn = []
        for page in pages:
            filled = [*(pdf.rectangle(*each) for each in page.rectangles), *(pdf.circle(*each) for each in page.discs)]
            stroked = [*(pdf.line(*each) for each in page.lines), *(pdf.circle(*each) for each in page.rings)]
            texts = [pdf.text(*each, _TEXT_MM) for each in page.texts]
            drawn.append((page.size_mm, pdf.page_content(filled, stroked, texts, _LINE_MM)))
        write_output(path, pdf.document(drawn))
        return [path]
    if path.suffix != ".svg":
        raise InputError(f"{path} ends in {path.suffix!r}: expected .pdf or .svg")
    several = len(pages) > 1
    names = [path.with_stem(f"{path.stem}_{k}") if several else path for k in range(len(pages))]
    for name, page in zip(names, pages, strict=True):
        write_output(name, page_svg(page))
    return names


def _template(target: Target, title: str, paper: str | None) -> PrintedPage:
    if np.abs(target.points[:, 2]).max() > 1e-6:
        raise InputError(f"a template is flat and the points of this {target.kind} are not: z must be 0 for all")
    at = 1e3 * target.points[:, :2]
    low, high = at.min(0) - 2 * _CROSS_MM, at.max(0) + 2 * _CROSS_MM
    name, size = _suitable_paper(float(high[0] - low[0]), float(high[1] - low[1]), paper)
    at = at + (np.array([size[0] - _SIDE_MM, size[1] - _FOOT_MM]) - high - low) / 2
    lines, texts = _rulers(size, title, "a cross where each point goes")
    arm = np.array([_CROSS_MM, 0.0])
    crosses = [np.concatenate([p - a, p + a]) for p in at for a in (arm, arm[::-1])]
    named = tuple((p[0] + 4, p[1] - 4, str(number)) for p, number in zip(at, target.ids, strict=True))
    rings = np.column_stack([at, np.full(len(at), _LIGHT_MM / 2)])
    return PrintedPage(
        name, size, np.zeros((0, 4)), np.zeros((0, 3)), rings, np.concatenate([lines, crosses]), texts + named
    )


def _orientations(paper: str) -> list[tuple[float, float]]:
    short, long = (_PAPERS | LETTER)[paper]
    return [(short, long), (long, short)]


def _suitable_paper(width: float, height: float, paper: str | None) -> tuple[str, tuple[float, float]]:
    """A paper's name and its size as it is turned [mm].

    Raises:
        InputError: if the requested paper is too small.
    """
    need = (width + 2 * _MARGIN_MM + _SIDE_MM, height + 2 * _MARGIN_MM + _FOOT_MM)
    for name in _PAPERS if paper is None else (paper,):
        for size in _orientations(name):
            if need[0] <= size[0] + 1e-6 and need[1] <= size[1] + 1e-6:
                return name, size
    if paper is not None:
        raise InputError(f"{width:g} x {height:g} mm and rulers do not fit on {paper}: print it smaller")
    least = _RULER_MM + 40
    return "custom", (float(np.ceil(max(need[0], least))), float(np.ceil(max(need[1], least))))


def _rulers(size: tuple[float, float], title: str, check: str) -> tuple[Array, tuple[tuple[float, float, str], ...]]:
    """Rulers below and at the right, and the words above the one below."""
    y, x = size[1] - _MARGIN_MM - 6, _MARGIN_MM + 4
    right = size[0] - _MARGIN_MM - 2
    lines = [[x, y, x + _RULER_MM, y], [right, y, right, y - _RULER_MM]]
    for t in np.arange(0, _RULER_MM + 1, 10):
        tick = 4 if t % 50 == 0 else 2.5
        lines += [[x + t, y, x + t, y - tick], [right, y - t, right - tick, y - t]]
    advice = f"both rulers are {_RULER_MM:g} mm: measure them; print at 100 %, do not fit to the page"
    return np.array(lines), ((x, y + 4, advice), (x, y - 11.5, title), (x, y - 7, check))


def _cut_marks(paper: Array) -> Array:
    """Two lines outwards from each corner of a sheet, whose left, top, right and bottom are given, (8, 4)."""
    left, top, right, bottom = paper
    marks = []
    for x, outwards in ((left, -1), (right, 1)):
        for y, down in ((top, -1), (bottom, 1)):
            start, end = _OFF_MM, _OFF_MM + _MARK_MM
            marks += [[x + outwards * start, y, x + outwards * end, y], [x, y + down * start, x, y + down * end]]
    return np.array(marks)


def _axes(sheet: Sheet, shift: Array) -> tuple[Array, tuple[tuple[float, float, str], ...]]:
    """Arrows above and left of a sheet, which begin where the target's origin is and go along its x and y."""
    sheet_from_target = sheet.target_from_sheet.inverse()
    origin = 1e3 * sheet_from_target.translation[:2] + shift
    left, top = 1e3 * sheet.paper[:2] + shift - _OFF_MM - 1
    lines, names = [], []
    for axis, name in enumerate("xy"):
        along = np.round(sheet_from_target.rotation[:2, axis], 9)
        if np.count_nonzero(along) != 1:
            continue  # a sheet that is not turned by quarters
        start = np.array([origin[0], top] if along[0] else [left, origin[1]])
        end, across = start + _AXIS_MM * along, along[::-1]
        lines.append([*start, *end])
        lines += [[*end, *(end - 1.5 * along + turn * across)] for turn in (-1, 1)]
        lines.append([*(start - across), *(start + across)])
        place = end + 1.5 * along
        names.append((float(place[0]), float(place[1]) + 1, name))
    return np.array(lines).reshape(-1, 4), tuple(names)


def page_svg(page: PrintedPage) -> str:
    """A page as SVG whose units are millimetres."""
    return fill_part("sheet.svg", page=page, line_mm=_LINE_MM, text_mm=_TEXT_MM)
