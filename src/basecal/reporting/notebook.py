"""A calibration as a notebook shows it: the verdict, and a table of transforms."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from basecal.cell import Calibration
from basecal.errors import check_type
from basecal.exchange.exports.digits import format_decimals
from basecal.reporting.statement.verdict import sort_by_severity, tolerance_sentence, verdict_word
from basecal.reporting.text import transform_rows

_COLOURS = {"PASS": "#1a7f45", "GOOD": "#1a7f45", "DOUBTFUL": "#a55b00"}
_OTHER_COLOUR = "#b3261e"


def html_summary(calibration: Calibration) -> str:
    """HTML of the verdict, what counts against it, and each transform with its sigmas along the axes of the child.

    Args:
        calibration: What came out.

    Raises:
        InputError: if it is no calibration.
    """
    check_type("calibration", calibration, Calibration)
    rows = ""
    for name in calibration.transforms:
        status, cells = calibration.status.get(name, "free"), []
        for row in transform_rows(name, calibration):
            sigmas = "" if status == "fixed" else _numbers(row.sigmas, row.decimals)
            cells += [_numbers(row.values, row.decimals), sigmas]
        row_cells = [escape(name), *cells, *[""] * (4 - len(cells)), escape(status)]
        rows += f"<tr>{''.join(f'<td>{cell}</td>' for cell in row_cells)}</tr>"
    titles = ("transform", "t [mm]", "1 sigma per axis", "rpy [deg]", "1 sigma per axis", "status")
    head = "".join(f"<th>{cell}</th>" for cell in titles)
    table = f"<table><tr>{head}</tr>{rows}</table>" if calibration.transforms else ""
    found = [
        f"<li><code>{escape(f.code)}</code> {escape(f.message)}</li>" for f in sort_by_severity(calibration.findings)
    ]
    word, tolerance = verdict_word(calibration), calibration.tolerance
    why = "" if tolerance is None or word == "REFUSED" else f" {escape(tolerance_sentence(tolerance))}"
    style = f"color:#fff;background:{_COLOURS.get(word, _OTHER_COLOUR)};padding:0.1em 0.5em;border-radius:4px"
    return f'<p><b style="{style}">{word}</b>{why}</p>{table}<ul>{"".join(found)}</ul>'


def _numbers(values: Iterable[float], decimals: int) -> str:
    return ", ".join(format_decimals(values, decimals))
