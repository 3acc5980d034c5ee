"""A target on paper at true scale, as SVG and PDF, with rulers both ways, sizes, axes and cut marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.cell import Target
from basecal.cell.format.writing import write_output
from basecal.cell.target import Sheet
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
_GAP_MM = 1.5  # between the target and marks beside it
_AXIS_MM = 10.0
_RULER_MM = 100.0
_LED_RING_MM = 5.0
_CROSS_MM = 8.0
_LINE_MM = 0.15
_TEXT_MM = 3.2  # height of letters with descenders
_RESERVED_MM = np.array([2 * _MARGIN_MM + _SIDE_MM, 2 * _MARGIN_MM + _FOOT_MM])  # of a page, not usable for the target

_NO_DISCS = np.zeros((0, 3))

Text = tuple[float, float, str]
"""X and y of the baseline's left end [mm], and the text."""


@dataclass(frozen=True, eq=False)
class PrintedPage:
    """Black shapes on one sheet of paper, in mm from its top left corner.

    Attributes:
        paper: Name of the paper, or `custom`.
        size_mm: Width and height.
        rectangles: Left, top, right, bottom, (n, 4).
        discs: Centre x, y and radius, (n, 3).
        rings: Centre x, y and radius of thin circles, (n, 3).
        lines: Thin lines from x, y to x, y, (n, 4).
        texts: Texts on the page.
    """

    paper: str
    size_mm: tuple[float, float]
    rectangles: Array
    discs: Array
    rings: Array
    lines: Array
    texts: list[Text]


def printed_pages(target: Target, title: str, paper: str | None = None) -> list[PrintedPage]:
    """Pages for all sheets of a target, with rulers and dimensions to check the print.

    Args:
        target: The target; for LEDs and points a template with crosses is drawn.
        title: Text above the ruler.
        paper: Paper such as `A4` or `letter`; None for the smallest that fits.

    Raises:
        InputError: if the paper is too small, or a template is requested of points off the plane z = 0.
    """
    if not target.sheets:
        return [_template(target, title, paper)]
    return [_sheet_page(target, sheet, title, paper) for sheet in target_drawing(target)]


def _sheet_page(target: Target, sheet: Sheet, title: str, paper: str | None) -> PrintedPage:
    box = 1e3 * sheet.paper
    part = next((key for key, value in target.options.items() if value == sheet.pitch), "size_m")
    width, height = box[2:] - box[:2]
    check = f"between the cut marks {width:g} x {height:g} mm; {part[:-2]} {1e3 * sheet.pitch:g} mm"
    axes, names = _axes(sheet)
    lines = [*_cut_marks(box), *axes]
    return _placed_page(box, paper, (title, check), names, lines, 1e3 * sheet.rectangles, 1e3 * sheet.discs, _NO_DISCS)


def _placed_page(
    box: Array,
    paper: str | None,
    captions: tuple[str, str],
    texts: Sequence[Text],
    lines: Sequence[Array],
    rectangles: Array,
    discs: Array,
    rings: Array,
) -> PrintedPage:
    """A page with shapes centred in the space beside the rulers; texts and shapes are in the axes of the box.

    Args:
        box: Left, top, right and bottom of the printed area [mm].
        paper: See `printed_pages`.
        captions: A title, and dimensions to check, above the ruler.
        texts: See `PrintedPage`.
        lines: See `PrintedPage`.
        rectangles: See `PrintedPage`.
        discs: See `PrintedPage`.
        rings: See `PrintedPage`.
    """
    low, high = np.split(box, 2)
    name, size = _suitable_paper(high - low, paper)
    rulers, page_texts = _rulers(size, *captions)
    x, y = (np.array(size) - (_SIDE_MM, _FOOT_MM) - high - low) / 2
    ends, centre = np.array([x, y, x, y]), np.array([x, y, 0])
    page_texts += [(left + x, base + y, word) for left, base, word in texts]
    page_lines = np.array([*rulers, *(lines + ends)])
    return PrintedPage(name, size, rectangles + ends, discs + centre, rings + centre, page_lines, page_texts)


def largest_pitch_mm(target: Target, paper: str) -> float:
    """The largest integer pitch [mm] at which all sheets of a target, scaled as a whole, fit on a paper.

    Args:
        target: The target with any pitch.
        paper: Paper such as `A4` or `letter`.
    """
    rooms_mm = [size - _RESERVED_MM for size in _orientations(paper)]
    pitches = [
        sheet.pitch * max(np.min(room / (sheet.paper[2:] - sheet.paper[:2])) for room in rooms_mm)
        for sheet in target.sheets
    ]
    return float(np.floor(min(pitches) + 1e-9))


def write_pages(pages: Sequence[PrintedPage], path: Path) -> list[Path]:
    """Write pages as one `.pdf` or as one `.svg` per page, and return the paths.

    Raises:
        InputError: if the file name has another ending, or a file cannot be written.
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
    is_numbered = len(pages) > 1
    names = [path.with_stem(f"{path.stem}_{k}") if is_numbered else path for k in range(len(pages))]
    for name, page in zip(names, pages, strict=True):
        write_output(name, page_svg(page))
    return names


def _template(target: Target, title: str, paper: str | None) -> PrintedPage:
    if np.abs(target.points[:, 2]).max() > 1e-6:
        raise InputError(f"a template is flat and the points of this {target.kind} are not: z must be 0 for all")
    points_mm = 1e3 * target.points[:, :2]
    box = np.concatenate([points_mm.min(0) - 2 * _CROSS_MM, points_mm.max(0) + 2 * _CROSS_MM])
    lines = [np.array([x - a, y - b, x + a, y + b]) for x, y in points_mm for a, b in ((_CROSS_MM, 0), (0, _CROSS_MM))]
    rings = np.column_stack([points_mm, np.full(len(points_mm), _LED_RING_MM / 2)])
    names = [(x + 4, y - 4, str(number)) for (x, y), number in zip(points_mm.tolist(), target.ids, strict=True)]
    return _placed_page(
        box, paper, (title, "a cross where each point goes"), names, lines, np.zeros((0, 4)), _NO_DISCS, rings
    )


def _orientations(paper: str) -> Array:
    """Width and height of a paper in portrait and in landscape format, (2, 2) [mm]."""
    size = (_PAPERS | LETTER)[paper]
    return np.array([size, size[::-1]])


def _suitable_paper(extent: Array, paper: str | None) -> tuple[str, tuple[float, float]]:
    """Name and oriented size [mm] of a paper for a target of given width and height, (2,) [mm].

    Raises:
        InputError: if the requested paper is too small.
    """
    need = extent + _RESERVED_MM
    for name in _PAPERS if paper is None else (paper,):
        for width, height in _orientations(name).tolist():
            if np.all(need <= (width + 1e-6, height + 1e-6)):
                return name, (width, height)
    if paper is not None:
        size = f"{extent[0]:g} x {extent[1]:g} mm"
        raise InputError(f"{size} and rulers do not fit on {paper}: print it smaller")
    width, height = np.ceil(np.maximum(need, _RULER_MM + 40)).tolist()
    return "custom", (width, height)


def _rulers(size: tuple[float, float], title: str, check: str) -> tuple[list[list[float]], list[Text]]:
    """Lines of the rulers at the bottom and on the right, and the texts at the bottom ruler."""
    y, x = size[1] - _MARGIN_MM - 6, _MARGIN_MM + 4
    right = size[0] - _MARGIN_MM - 2
    lines = [[x, y, x + _RULER_MM, y], [right, y, right, y - _RULER_MM]]
    for t in np.arange(0, _RULER_MM + 1, 10):
        tick = 4 if t % 50 == 0 else 2.5
        lines += [[x + t, y, x + t, y - tick], [right, y - t, right - tick, y - t]]
    advice = f"both rulers are {_RULER_MM:g} mm: measure them; print at 100 %, do not fit to the page"
    return lines, [(x, y + 4, advice), (x, y - 11.5, title), (x, y - 7, check)]


def _cut_marks(paper: Array) -> list[Array]:
    """Cut marks: two outward lines at each corner of a sheet, from its left, top, right and bottom."""
    left, top, right, bottom = paper
    near, far = _GAP_MM, _GAP_MM + _MARK_MM
    return [
        np.array([x + near * a, y + near * b, x + far * a, y + far * b])
        for x, outwards in ((left, -1), (right, 1))
        for y, down in ((top, -1), (bottom, 1))
        for a, b in ((outwards, 0), (0, down))
    ]


def _axes(sheet: Sheet) -> tuple[list[Array], list[Text]]:
    """Arrows above and left of a sheet that start at the target's origin, along its x and y axes."""
    sheet_from_target = sheet.target_from_sheet.inverse()
    origin = 1e3 * sheet_from_target.translation[:2]
    edge = 1e3 * sheet.paper[:2] - _GAP_MM - 1
    lines, names = list[Array](), list[Text]()
    for axis, name in enumerate("xy"):
        along = np.round(sheet_from_target.rotation[:2, axis], 9)
        if np.count_nonzero(along) != 1:
            continue  # the sheet's axes are not parallel to the target's
        start = np.where(along, origin, edge)
        end, across = start + _AXIS_MM * along, along[::-1]
        barbs = [(end, end - 1.5 * along + side * across) for side in (-1, 1)]
        lines += map(np.concatenate, [(start, end), *barbs, (start - across, start + across)])
        x, y = (end + 1.5 * along).tolist()
        names.append((x, y + 1, name))
    return lines, names


def page_svg(page: PrintedPage) -> str:
    """A page as SVG in millimetres."""
    return fill_part("sheet.svg", page=page, line_mm=_LINE_MM, text_mm=_TEXT_MM)
