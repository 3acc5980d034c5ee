"""Terminal view of a capture: image coverage, sigma of the base, and the next step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from basecal.acquisition.coverage import Coverage
from basecal.acquisition.watching import Sigma, Snapshot
from basecal.errors import count_text
from basecal.reporting.statement.verdict import error_text

_BARS = "▁▂▃▄▅▆▇█"
_WIDEST_ROW = 40  # largest number of bars
_SEEN_MARK, _OPEN_MARK = "██", "··"


def terminal_view(snapshot: Snapshot) -> RenderableType:
    """View of a capture as a rich renderable."""
    now = Text(snapshot.activity, style="bold")
    messages = Text("\n".join(snapshot.lines), style="dim")
    if snapshot.step is None:
        return Group(now, messages)
    turned = "\n".join(
        f"{robot}  " + "  ".join(f"{axis} {angle:.0f}" for axis, angle in zip("xyz", np.degrees(angles), strict=True))
        for robot, angles in snapshot.step.coverage.rotation_ranges_rad.items()
    )
    table = Table.grid(padding=(0, 3))
    table.add_row(Text("covered"), Text("base" if snapshot.sigmas else ""), Text("turned, deg"))
    table.add_row(
        Text(coverage_rows(snapshot.step.coverage)), Text(sigma_row(snapshot.sigmas, snapshot.step.taken)), Text(turned)
    )
    title = f"{snapshot.step.taken} taken, {snapshot.step.planned} planned"
    parts: list[RenderableType] = [Panel(table, title=title, expand=False), messages]
    parts += [Text(doubt, style="bold red") for doubt in snapshot.doubts]
    if snapshot.advice:
        parts.append(Text(f"next: {snapshot.advice}", style="yellow"))
    return Group(*parts, now)


def coverage_rows(coverage: Coverage) -> str:
    """Coverage of the image, a line for each row of cells; covered cells are filled."""
    return "\n".join("".join(_SEEN_MARK if seen else _OPEN_MARK for seen in row) for row in coverage.cells)


def sigma_row(sigmas: Sequence[Sigma], sample_count: int = 0) -> str:
    """Bars of the logarithm of the translation's sigma, and the last sigma in numbers.

    Args:
        sigmas: Sigmas after each sample.
        sample_count: Number of samples so far; the last sigma may not include all of them.
    """
    if not sigmas:
        return "not all directions\nare observed yet"
    shown = sigmas[-_WIDEST_ROW:]
    levels = np.log([sigma.t_m for sigma in shown])
    extent = max(float(np.ptp(levels)), 1e-6)
    heights = np.rint((levels - levels.min()) / extent * (len(_BARS) - 1)).astype(int)
    last = sigmas[-1]
    note = f", after {count_text(last.samples, 'sample')}" if last.samples < sample_count else ""
    bars = "".join(_BARS[k] for k in heights)
    return f"{bars}\n{error_text(last.t_m, last.r_rad)}\n(1 sigma, 3-D norm{note})"
