"""Summary of a calibration in about fifteen lines: the verdict, requested transforms with sigma, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from textwrap import wrap

from basecal.cell import Calibration, Cell, Finding
from basecal.reporting.statement.verdict import (
    held_out_errors,
    requested_estimates,
    sort_by_severity,
    tolerance_sentence,
    transform_sentence,
    verdict_word,
    work_sentences,
)
from basecal.reporting.text import certificate_lines, local_rows, number_row, rival_lines, task_sentence, transform_rows

LINE_WIDTH = 100
"""Largest number of characters of a line, which terminals and mails show unbroken."""

_FULL_TRANSFORMS = 3  # transforms with all their numbers; others have one line
_FULL_FINDINGS = 4  # findings with their full text; further ones usually share a cause with the first
_INFO_LINES = 14  # lines of a summary up to which infos have their full text instead of their code
_EMPTY_ANSWER = "no requested transform is observable."


def summary(cell: Cell, calibration: Calibration) -> str:
    """Lines of at most `LINE_WIDTH` characters, joined by newlines; see `text_report` for the whole report.

    Args:
        cell: The calibrated cell, which states the requested transforms.
        calibration: The calibration.
    """
    requested = requested_estimates(cell, calibration)
    findings = dict.fromkeys(sort_by_severity(calibration.findings))
    severe = [finding for finding in findings if finding.severity != "info"]
    paragraphs = [(reason, list[str]()) for reason in _reasons(calibration, severe, requested)]
    for index, name in enumerate(requested):
        rows = list(_rows(name, calibration)) if index < _FULL_TRANSFORMS else []
        paragraphs.append((transform_sentence(name, calibration), rows))
    (first, rows), *others = paragraphs or [(_EMPTY_ANSWER, [])]
    lines = [*wrap_text(f"{verdict_word(calibration)}: {first}"), *rows]
    for sentence, rows in others:
        lines += [*wrap_text(sentence), *rows]
    lines += wrap_text(task_sentence(calibration))
    if calibration.settings.get("task_box") is not None:
        lines += [line for sentence in local_rows(calibration) for line in wrap_text(sentence)]
    errors = held_out_errors(calibration.validation)
    lines += wrap_text(f"cross-validation error, rms: {', '.join(errors)}") if errors else []
    lines += [] if calibration.validation is None else rival_lines(calibration.validation)
    lines += [line for sentence in certificate_lines(calibration) for line in wrap_text(sentence)]
    lines += _finding_lines(severe[1:_FULL_FINDINGS])
    minor = [*severe[_FULL_FINDINGS:], *(finding for finding in findings if finding.severity == "info")]
    in_full = _finding_lines(minor)
    if len(lines) + len(in_full) <= _INFO_LINES:
        lines += in_full
    elif minor:
        count_by_code = Counter(finding.code for finding in minor)
        codes = ", ".join(code if times == 1 else f"{code} ({times})" for code, times in count_by_code.items())
        lines += wrap_text(f"also found, see --verbose: {codes}")
    return "\n".join(lines)


def _reasons(calibration: Calibration, severe: Sequence[Finding], names: Sequence[str]) -> Iterator[str]:
    """First sentences of a summary: the verdict on the tolerance, the most severe finding, the expected error."""
    tolerance = calibration.tolerance
    decides = tolerance is not None and verdict_word(calibration) in ("PASS", "FAIL")
    if tolerance is not None and decides:
        yield tolerance_sentence(tolerance)
    for finding in severe[:1]:
        yield f"{finding.severity}: {_finding_sentence(finding)}" if decides else _finding_sentence(finding)
    if tolerance is not None and not decides and calibration.verdict != "refused":
        yield tolerance_sentence(tolerance)
    elif tolerance is None and names:
        yield from work_sentences(calibration)


def wrap_text(text: str) -> list[str]:
    """A sentence as lines of at most `LINE_WIDTH` characters, indented after the first."""
    return wrap(text, LINE_WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _finding_lines(findings: Sequence[Finding]) -> list[str]:
    return [line for finding in findings for line in wrap_text(f"{finding.severity}: {_finding_sentence(finding)}")]


def _finding_sentence(finding: Finding) -> str:
    return f"{finding.message} [{finding.code}]"


def _rows(name: str, calibration: Calibration) -> Iterator[str]:
    """Rows of translation and rotation of a transform, each followed by its sigma along the axes of the child."""
    for what, unit, values, sigmas in transform_rows(name, calibration):
        yield f"  {what:<5}{number_row(values)} {unit}"
        if sigmas:
            yield f"  sigma{number_row(sigmas)}"
