"""A calibration in about fifteen lines: the verdict, what was asked with its sigma, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from textwrap import wrap

import numpy as np

from basecal.cell import Calibration, Cell, Finding, Validation
from basecal.geometry import Array
from basecal.reporting.text import (
    local_rows,
    rival_lines,
    sigma_norms,
    sort_by_severity,
    task_sentence,
    tolerance_sentence,
)

LINE_WIDTH = 100
"""Characters of a line at most: what terminals show, and mails keep, unbroken."""

_FULL_TRANSFORMS = 3  # transforms with all their numbers, of which a line tells the others
_FULL_FINDINGS = 4  # findings that are told in full: more have one cause, which is among the first
_INFO_LINES = 14  # lines into which what only informs has to fit, or is named by its code
_SIGMA_DIGITS = 2  # significant ones; the second is uncertain itself
_EXACT_DECIMALS, _MOST_DECIMALS = 4, 6  # of mm and deg: where nothing is uncertain, and at most
_COLUMN_WIDTH = 13  # characters of a number in a row


def summary(cell: Cell, calibration: Calibration) -> str:
    """Lines of at most `LINE_WIDTH` characters, joined by newlines; `text_report` tells all else.

    Args:
        cell: What was calibrated: it says which transforms are requested.
        calibration: What came out.
    """
    asked = [name for name in cell.asked if name in calibration.transforms]
    findings = dict.fromkeys(sort_by_severity(calibration.findings))
    grave = [finding for finding in findings if finding.severity != "info"]
    known = [_transform_line(name, calibration) for name in asked]
    word = calibration.verdict.upper()
    if grave or not known:
        lines = wrap_text(
            f"{word}: {_finding_sentence(grave[0]) if grave else 'no transform is asked for and observable.'}"
        )
    else:
        lines, known[0] = [], f"{word}: {known[0]}"
    if calibration.tolerance is not None:
        lines = [*wrap_text(tolerance_sentence(calibration.tolerance)), *lines]
    for place, (name, sentence) in enumerate(zip(asked, known, strict=True)):
        lines += [*wrap_text(sentence), *(_rows(name, calibration) if place < _FULL_TRANSFORMS else ())]
    lines += wrap_text(task_sentence(calibration)) if calibration.budget else []
    if calibration.settings.get("task_box") is not None:
        lines += [line for sentence in local_rows(calibration) for line in wrap_text(sentence)]
    lines += _validation(calibration.validation)
    lines += _finding_lines(grave[1:_FULL_FINDINGS])
    others = [*grave[_FULL_FINDINGS:], *(finding for finding in findings if finding.severity == "info")]
    in_full = _finding_lines(others)
    if len(lines) + len(in_full) <= _INFO_LINES:
        lines += in_full
    else:
        count = Counter(finding.code for finding in others)
        codes = ", ".join(code if times == 1 else f"{code} ({times})" for code, times in count.items())
        lines += wrap_text(f"also found, see --verbose: {codes}")
    return "\n".join(lines)


def wrap_text(text: str) -> list[str]:
    """A sentence as lines of at most `LINE_WIDTH` characters, all but the first set in."""
    return wrap(text, LINE_WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _finding_lines(findings: Sequence[Finding]) -> list[str]:
    return [line for finding in findings for line in wrap_text(f"{finding.severity}: {_finding_sentence(finding)}")]


def _finding_sentence(finding: Finding) -> str:
    return f"{finding.message} [{finding.code}]"


def _transform_line(name: str, calibration: Calibration) -> str:
    sigma_mm, sigma_deg = sigma_norms(calibration[name])
    angle = "" if name in calibration.points else f" and {_digits(sigma_deg)} deg"
    return f"{name} to {_digits(sigma_mm)} mm{angle} (1 sigma)"


def _rows(name: str, calibration: Calibration) -> Iterator[str]:
    """Translation and, but of a point, angles, each above its sigma along the axes of the frame on the right."""
    estimate = calibration[name]
    halves = [("t", "mm", estimate.mean.translation * 1e3, estimate.sigma_t * 1e3)]
    if name not in calibration.points:
        halves.append(("rpy", "deg", np.degrees(estimate.mean.rpy), np.degrees(estimate.sigma_r)))
    for what, unit, values, sigmas in halves:
        # So many that the smallest of the sigmas shows two digits.
        uncertain, decimals = sigmas[sigmas > 0], _EXACT_DECIMALS
        if len(uncertain):
            first = int(np.floor(np.log10(uncertain.min())))
            decimals = int(np.clip(_SIGMA_DIGITS - 1 - first, 0, _MOST_DECIMALS))
        yield f"  {what:<5}{_row(values, decimals)} {unit}"
        yield f"  sigma{_row(sigmas, decimals)}"


def _row(values: Array, decimals: int) -> str:
    return "".join(f" {round(float(value), decimals) + 0.0:{_COLUMN_WIDTH}.{decimals}f}" for value in values)


def _validation(validation: Validation | None) -> list[str]:
    """How far off held-out samples are predicted."""
    if validation is None:
        return []
    errors = []
    if validation.target_m is not None and validation.target_rad is not None:
        degrees = float(np.degrees(validation.target_rad))
        errors.append(f"{_digits(validation.target_m * 1e3)} mm and {_digits(degrees)} deg at the target")
    if validation.rms_px is not None:
        errors.append(f"{_digits(validation.rms_px)} px")
    lines = wrap_text(f"cross-validation error, rms: {', '.join(errors)}") if errors else []
    return [*lines, *rival_lines(validation)]


def _digits(value: float) -> str:
    """A number with two significant digits and no exponent."""
    if value == 0:
        return "0"
    decimals = int(np.clip(_SIGMA_DIGITS - 1 - int(np.floor(np.log10(value))), 0, _MOST_DECIMALS))
    return f"{value:.{decimals}f}"
