"""`board-size` where robots' noise is known: the suggestion of arms that were assumed exact, in better numbers."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.accuracy.phrases.target_length import as_written
from basecal.cell import Cell, Finding
from basecal.effects.faces.effect import FoundEffect, format_with_sigma

_CODES = "board-size", "length-scale"


def deduplicate_size_findings(cell: Cell, findings: Sequence[Finding], error: FoundEffect | None) -> list[Finding]:
    """The findings, with one of lengths if two report the same.

    The test of conventions assumes that robots are exact, so its size absorbs some of their noise. The test of
    systematic errors estimates the noise with the size.

    Args:
        cell: As declared.
        findings: All of them.
        error: The systematic error; None where there is none.
    """
    suspected = any(f.code == "board-size" and f.severity == "warning" for f in findings)
    if not suspected or error is None or error.code != "length-scale" or not error.is_certain:
        return list(findings)
    either = [each for each in (error, *error.alternatives) if each.code == "length-scale"]
    size = next((each for each in either if each.is_target), None)
    if size is None:
        return [f for f in findings if f.code != "board-size"]
    target, factor = size.about, 1 / (1 - size.size[0])
    sigma = size.sigma * factor**2
    what = f"{target} is {format_with_sigma(factor, sigma)} times as large as stated"
    robots = [each.about for each in either if not each.is_target]
    if robots:
        what += f" if the lengths of the poses of {' and '.join(robots)} are right, which the data do not determine"
    do = (f"Measure {target} and state its true size{as_written(cell, target, factor)}.",)
    why = "The answer excludes it, and its covariance is wider."
    finding = Finding("board-size", "warning", (target,), f"{what}.", do, why)
    return [finding, *(f for f in findings if f.code not in _CODES)]
