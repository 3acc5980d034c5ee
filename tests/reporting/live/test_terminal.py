"""Tests of the view of a capture in the terminal."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
from rich.console import Console

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import Sigma, Watch
from basecal.reporting.live.terminal import coverage_rows, sigma_row, terminal_view


def make_coverage():
    cells = np.zeros(COVERAGE_GRID, dtype=bool)
    cells[0, 0] = cells[3, 5] = True
    return Coverage(cells, {"eye": np.radians([5.0, 40.0, 40.0]), "hand": np.radians([50.0, 40.0, 40.0])})


def print_view(glance):
    out = io.StringIO()
    Console(file=out, width=100).print(terminal_view(glance))
    return out.getvalue()


def test_covered_parts_are_filled():
    """Each row of the image is a line, and each part has two characters."""
    rows = coverage_rows(make_coverage()).split("\n")
    assert rows[0] == "██" + "··" * 5
    assert rows[3] == "··" * 5 + "██"


def test_sigma_bars_decrease():
    """The first bar is the highest, and the last sigma is given in numbers."""
    bars, size, word = sigma_row([Sigma(k, 1.2e-3 / k, 1e-3) for k in range(1, 9)]).split("\n")
    assert bars[0] == "█"
    assert bars[-1] == "▁"
    assert list(bars) == sorted(bars, reverse=True)
    assert (size, word) == ("0.15 mm and 0.057 deg", "(1 sigma, 3-D norm)")


def test_terminal_view_shows_progress():
    """The view has the counts, the results of samples and the next step.

    Before the first sample it has only a status.
    """
    watch = Watch()
    assert "opening" in print_view(watch.snapshot)
    watch.note(Step(7, "too similar to sample 4", 6, 25, make_coverage(), None))
    watch.notify("sample 8: arms move")
    shown = print_view(watch.snapshot)
    for words in ("6 taken, 25 planned", "sample 7: not taken: too similar to sample 4", "rotate eye further about x",
                  "sample 8: arms move", "hand  x 50  y 40  z 40", "not all directions"):  # fmt: skip
        assert words in shown


def test_sigma_column_has_conditional_header():
    """The header appears with the first sigma. At most the last forty bars are drawn, and equal ones are low."""
    watch = Watch()
    watch.note(Step(7, None, 6, 25, make_coverage(), None))
    assert "base" not in print_view(replace(watch.snapshot, sigmas=()))
    assert "base" in print_view(replace(watch.snapshot, sigmas=(Sigma(1, 1e-3, 1e-3),)))
    assert sigma_row([Sigma(k, 1e-3, 1e-3) for k in range(41)]).split("\n")[0] == "▁" * 40
    assert sigma_row([]) == "not all directions\nare observed yet"
    assert sigma_row([Sigma(5, 1e-3, 1e-3)], 5).endswith("(1 sigma, 3-D norm)")
    assert sigma_row([Sigma(5, 1e-3, 1e-3)], 12).endswith("(1 sigma, 3-D norm, after 5 samples)")
    half = sigma_row([Sigma(0, 1e-3, 1e-3), Sigma(1, 1e-3 * np.exp(0.5), 1e-3), Sigma(2, 1e-3 * np.e, 1e-3)])
    assert half[:3] in ("▁▄█", "▁▅█")
    assert half[3] == "\n"
