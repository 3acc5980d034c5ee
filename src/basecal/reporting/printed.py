"""A target on paper at true scale, with a ruler to check the print, as SVG and PDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from basecal.cell import Target
from basecal.cell.format.writing import write_output
from basecal.errors import InputError
from basecal.geometry import Array
from basecal.reporting import pdf
from basecal.vision.draw.drawing import target_drawing

_PAPERS = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
_MARGIN_MM = 8.0
_FOOT_MM = 22.0
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


def printed_pages(target: Target, title: str) -> list[PrintedPage]:
    """Every sheet of a target, each on the smallest paper that holds it with a ruler below.

    Args:
        target: What is printed; for lights and points a template with crosses is drawn.
        title: Printed beside the ruler.

    Raises:
        InputError: if a template is requested points that do not lie in a plane z = 0.
    """
    if not target.sheets:
        return [_template(target, title)]
    pages = []
    for sheet in target_drawing(target):
        left, top, right, bottom = 1e3 * sheet.paper
        paper, size = _paper_for(right - left, bottom - top)
        shift = np.array([(size[0] - right - left) / 2, (size[1] - _FOOT_MM - bottom - top) / 2])
        discs = 1e3 * sheet.discs
        discs[:, :2] += shift
        rectangles = 1e3 * sheet.rectangles + np.tile(shift, 2)
        pages.append(PrintedPage(paper, size, rectangles, discs, np.zeros((0, 3)), *_ruler(size, title)))
    return pages


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


def _template(target: Target, title: str) -> PrintedPage:
    if np.abs(target.points[:, 2]).max() > 1e-6:
        raise InputError(f"a template is flat and the points of this {target.kind} are not: z must be 0 for all")
    at = 1e3 * target.points[:, :2]
    low, high = at.min(0) - 2 * _CROSS_MM, at.max(0) + 2 * _CROSS_MM
    paper, size = _paper_for(*(high - low))
    at = at + (np.array([size[0], size[1] - _FOOT_MM]) - high - low) / 2
    lines, texts = _ruler(size, title)
    arm = np.array([_CROSS_MM, 0.0])
    crosses = [np.concatenate([p - a, p + a]) for p in at for a in (arm, arm[::-1])]
    named = tuple((p[0] + 4, p[1] - 4, str(number)) for p, number in zip(at, target.ids, strict=True))
    rings = np.column_stack([at, np.full(len(at), _LIGHT_MM / 2)])
    return PrintedPage(
        paper, size, np.zeros((0, 4)), np.zeros((0, 3)), rings, np.concatenate([lines, crosses]), texts + named
    )


def _paper_for(width: float, height: float) -> tuple[str, tuple[float, float]]:
    need = (width + 2 * _MARGIN_MM, height + 2 * _MARGIN_MM + _FOOT_MM)
    for name, (short, long) in _PAPERS.items():
        for size in ((short, long), (long, short)):
            if need[0] <= size[0] and need[1] <= size[1]:
                return name, size
    return "custom", (float(np.ceil(max(need[0], _RULER_MM + 40))), float(np.ceil(need[1])))


def _ruler(size: tuple[float, float], title: str) -> tuple[Array, tuple[tuple[float, float, str], ...]]:
    y, x = size[1] - _MARGIN_MM - 6, _MARGIN_MM + 4
    ticks = [[x + t, y, x + t, y - (4 if t % 50 == 0 else 2.5)] for t in np.arange(0, _RULER_MM + 1, 10)]
    lines = np.array([[x, y, x + _RULER_MM, y], *ticks])
    advice = f"{_RULER_MM:g} mm: measure it; print at 100 %, do not fit to the page"
    return lines, ((x, y + 4, advice), (x, y - 8, title))


def page_svg(page: PrintedPage) -> str:
    """A page as SVG whose units are millimetres."""
    width, height = page.size_mm
    rectangles = "".join(f"M{a:.4f} {b:.4f}H{c:.4f}V{d:.4f}H{a:.4f}Z" for a, b, c, d in page.rectangles)
    lines = "".join(f"M{a:.4f} {b:.4f}L{c:.4f} {d:.4f}" for a, b, c, d in page.lines)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}">',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<path d="{rectangles}" shape-rendering="crispEdges"/>' if rectangles else "",
        *(f'<circle cx="{x:.4f}" cy="{y:.4f}" r="{r:.4f}"/>' for x, y, r in page.discs),
        f'<g fill="none" stroke="#000" stroke-width="{_LINE_MM}"><path d="{lines}"/>',
        *(f'<circle cx="{x:.4f}" cy="{y:.4f}" r="{r:.4f}"/>' for x, y, r in page.rings),
        f'</g><g font-family="sans-serif" font-size="{_TEXT_MM}">',
        *(f'<text x="{x:.3f}" y="{y:.3f}">{escape(text)}</text>' for x, y, text in page.texts),
        "</g></svg>",
    ]
    return "\n".join(part for part in parts if part) + "\n"
