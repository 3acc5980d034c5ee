"""HTML of a calibration for notebooks: the verdict, and a table of transforms."""

from __future__ import annotations

from basecal.cell import Calibration
from basecal.errors import check_type
from basecal.reporting.statement.verdict import COLOURS, sort_by_severity, tolerance_sentence, verdict_word
from basecal.reporting.templates.environment import fill_part
from basecal.reporting.text import status_words, transform_rows

_COLOURS = {"good": "#1a7f45", "doubtful": "#9a5500", "refused": "#b3261e"}  # of the page in its light scheme


def html_summary(calibration: Calibration) -> str:
    """HTML of the verdict, the findings, and each transform with its sigmas along the axes of the child.

    Args:
        calibration: The calibration.

    Raises:
        InputError: if the argument is not a calibration.
    """
    check_type("calibration", calibration, Calibration)
    word, tolerance = verdict_word(calibration), calibration.tolerance
    return fill_part(
        "notebook.html",
        word=word,
        colour=_COLOURS[COLOURS[word]],
        why="" if tolerance is None or word == "REFUSED" else tolerance_sentence(tolerance),
        calibration=calibration,
        status_words=status_words,
        transform_rows=transform_rows,
        findings=sort_by_severity(calibration.findings),
    )
