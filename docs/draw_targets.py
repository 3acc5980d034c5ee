"""Draw each kind of target with its frame and ids, and write the table of kinds: `python docs/draw_targets.py`."""

from __future__ import annotations

import re
from pathlib import Path

from basecal.cell import Target
from basecal.cell.targets.registry import TARGETS
from basecal.vision.draw.drawing import target_drawing

FIGURES = Path(__file__).parent / "figures"
SCALE = 1500.0


def drawn(target: Target) -> str:
    """The target in grey, its x axis red, y green, z a cross into or a dot out of the page, and an id at each point."""
    (sheet,) = target_drawing(target)
    sheet_from_target = sheet.target_from_sheet.inverse()
    left, top, right, bottom = SCALE * sheet.paper
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.0f} {top:.0f} {right - left:.0f} {bottom - top:.0f}" '
        f'width="{right - left:.0f}" font-family="system-ui, sans-serif" font-size="13">',
        f'<rect x="{left}" y="{top}" width="{right - left}" height="{bottom - top}" fill="#fff" stroke="#bbb"/>',
    ]
    for a, b, c, d in SCALE * sheet.rectangles:
        parts.append(f'<rect x="{a:.1f}" y="{b:.1f}" width="{c - a:.1f}" height="{d - b:.1f}" fill="#b9b9b9"/>')
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" fill="#b9b9b9"/>' for x, y, r in SCALE * sheet.discs]
    for number, (x, y, _) in zip(target.ids, SCALE * (sheet_from_target @ target.points), strict=True):
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="#1f6fb2"/>')
        parts.append(f'<text x="{x + 5:.1f}" y="{y - 5:.1f}" fill="#1f6fb2" font-weight="600">{number}</text>')
    for axis, colour, name in ((0, "#c0392b", "x"), (1, "#2e8b57", "y")):
        tip = 62 * sheet_from_target.rotation[:2, axis]
        parts.append(f'<path d="M0 0L{tip[0]:.0f} {tip[1]:.0f}" stroke="{colour}" stroke-width="4"/>')
        parts.append(
            f'<text x="{tip[0] + 5:.0f}" y="{tip[1] + 14:.0f}" fill="{colour}" font-weight="700">{name}</text>'
        )
    into = sheet_from_target.rotation[2, 2] > 0
    mark = '<path d="M-5 -5L5 5M-5 5L5 -5" stroke="#1b2a8f"/>' if into else '<circle r="2.5" fill="#1b2a8f"/>'
    parts.append(f'<circle r="7" fill="#fff" stroke="#1b2a8f" stroke-width="2"/>{mark}')
    return "\n".join([*parts, "</svg>"]) + "\n"


def table() -> str:
    """The rows of docs/data_format.md that say what each kind of target has."""
    rows = ["| kind | fields | ids of the points | origin of the frame |", "|---|---|---|---|"]
    rows += [f"| `{name}` | {' | '.join(TARGETS[name].description)} |" for name in TARGETS]
    return "\n".join(rows)


def with_table(text: str) -> str:
    """The text of docs/data_format.md with the present table in it."""
    return re.sub(r"\| kind \| fields .*?\|(?=\n\n)", lambda _: table(), text, count=1, flags=re.S)


if __name__ == "__main__":
    for kind in TARGETS:
        for name, shape in TARGETS[kind].figures.items():
            (FIGURES / f"target_{name}.svg").write_text(drawn(shape), encoding="utf-8")
    page = Path(__file__).parent / "data_format.md"
    page.write_text(with_table(page.read_text(encoding="utf-8")), encoding="utf-8")
