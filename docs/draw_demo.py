"""Draw the first image of the README from a cell that `basecal demo` made: `python docs/draw_demo.py demo_cell`."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from html import escape
from pathlib import Path

from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording
from basecal.errors import InputError
from basecal.reporting.cell_view.picture import picture
from basecal.reporting.cell_view.scene import scene
from basecal.reporting.summary import summary

FIGURE = Path(__file__).parent / "figures" / "demo.svg"
FRAMES, FRAME_S = 12, 0.8  # samples shown, and for how long each
WIDTH, HEIGHT, LEFT, LINE = 1240, 470, 620, 23
STYLE = """
text{font:14px ui-monospace,Menlo,Consolas,monospace;fill:#e8eaed;white-space:pre}
.cell text{font:14px system-ui,sans-serif;fill:#1b1f24;text-anchor:middle}
.prompt{fill:#a3acb8}.good{fill:#5cc58a;font-weight:700}
.cell path{fill:none;stroke-width:1.5;stroke-linecap:round;stroke-linejoin:round}
.cell .floor{stroke:#d9dde3;stroke-dasharray:6 5}.cell .trail{stroke-width:3.5;opacity:.6}
.cell .links{stroke-width:8;opacity:.75}.cell .robot-0{stroke:#b5541c}.cell .robot-1{stroke:#1f6fb2}
.cell text.robot-0,.cell text.robot-1{stroke:none}
.cell .axis-x{stroke:#d0342c}.cell .axis-y{stroke:#1f9447}.cell .axis-z{stroke:#2f62d9}
.cell .ellipsoid{stroke:#9a5500}.cell .camera{stroke:#1b1f24}.cell .target{stroke:#6a4fb3;stroke-width:2}
"""


def frames(folder: Path) -> Iterator[str]:
    """The cell at some of its samples, each shown in its turn."""
    cell, calibration = read_cell(folder), read_calibration(run_of(folder))
    drawn = scene(cell, read_recording(folder, cell).samples, calibration)
    for place in range(FRAMES):
        opening = place * len(drawn.samples) // FRAMES
        inside = re.sub(r"^<svg[^>]*>|</svg>$|<title>.*?</title>", "", picture(replace(drawn, opening=opening)))
        yield f'<g class="frame f{place}">{inside}</g>'


def run_of(folder: Path) -> Path:
    """The latest run of a cell."""
    run = latest_run(folder)
    if run is None:
        raise InputError(f"{folder} has no run yet: basecal demo {folder}")
    return run


def terminal(folder: Path) -> Iterator[str]:
    """What is typed, and what the program prints."""
    lines = summary(read_cell(folder), read_calibration(run_of(folder))).splitlines()[:6]
    word, colon, rest = lines[0].partition(":")
    yield '<tspan class="prompt">$ </tspan>basecal demo'
    yield f'<tspan class="good">{word}</tspan>{colon}{escape(rest)}'
    yield from map(escape, lines[1:])


def drawing(folder: Path) -> str:
    """The drawing: the terminal at the left, the cell as it is captured at the right."""
    share = 100 / FRAMES
    turns = "".join(f".f{k}{{animation-delay:{FRAME_S * k:.1f}s}}" for k in range(1, FRAMES))
    blink = f"@keyframes turn{{0%,{share:.2f}%{{opacity:1}}{share + 0.01:.2f}%,100%{{opacity:0}}}}"
    play = f".frame{{opacity:0;animation:turn {FRAMES * FRAME_S:.1f}s infinite step-end}}.f0{{opacity:1}}"
    still = "@media (prefers-reduced-motion:reduce){.frame{animation:none}}"
    rows = [f'<text x="20" y="{70 + LINE * k}">{row}</text>' for k, row in enumerate(terminal(folder))]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
            'aria-label="basecal demo: two simulated arms are captured and calibrated">',
            f"<style>{STYLE}{play}{turns}{blink}{still}</style>",
            f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="#f4f5f7"/>',
            f'<rect width="{LEFT - 10}" height="{HEIGHT}" rx="10" fill="#1d2126"/>',
            *rows,
            f'<g class="cell" transform="translate({LEFT} 20) scale(0.95)">',
            *frames(folder),
            "</g></svg>\n",
        ]
    )


if __name__ == "__main__":
    FIGURE.write_text(drawing(Path(sys.argv[1])), encoding="utf-8")
