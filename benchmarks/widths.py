"""Contributions to the sigmas on each real recording.

For each requested transform the variance of its translation and of its rotation is split by source: views, robots'
stops and priors at the likeliest sigmas; errors that stops share, and the uncertainty of sigmas; detected effects;
effects that every answer contains (gravity on mounts and lenses, sizes of targets, fields of arms); clocks; and gauges
that are held at zero.

    python -m benchmarks.widths --only akig
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import JUDGING_STAGES, READING_STAGES, SOLVING_STAGES
from basecal.accuracy.held_gauges import held_gauges
from basecal.accuracy.stages.case import Case
from basecal.accuracy.systematic_errors.expected_sizes import with_expected_sizes
from basecal.accuracy.task.budget import SHARED_SOURCE, error_sources, source_variance
from basecal.errors import BasecalError
from basecal.estimation.settings import DEFAULT
from basecal.geometry import Array
from benchmarks.common import Kept, on_one_core, table, write
from benchmarks.reference.cases import cases

DETECTED, CONTAINED, CLOCKS = "effects that were found", "effects that every answer contains", "offsets of clocks"
LARGEST_TERMS = 4  # in a line of the table
HEAD = ("recording", "transform", "verdict", "sigma", "terms, percent of the variance")
UNITS = {"mm": slice(0, 3), "mrad": slice(3, 6)}


def variance_rows(name: str) -> list[dict[str, Any]]:
    """Rows of a case of the reference for each transform and unit: the sigma (3-D norm), and shares of its variance."""
    try:
        case = _run_stages(Case(*cases()[name](), DEFAULT))
    except BasecalError:
        return []
    assert case.calibration is not None
    if not case.answers or case.calibration.verdict == "refused":
        return []
    rows = []
    for transform in case.cell.requested_transforms:
        block = case.answers[0].problem.columns.get(transform)
        if block is None or transform not in case.calibration.transforms:
            continue
        for unit, part in UNITS.items():
            columns = np.arange(block.start, block.stop)[part]
            terms = dict(_terms(case, transform, columns)) if len(columns) else {}
            if total := sum(terms.values()):
                shares = {term: value / total for term, value in sorted(terms.items(), key=lambda each: -each[1])}
                row = {"transform": transform, "unit": unit, "sigma": 1e3 * float(np.sqrt(total)), "shares": shares}
                rows.append({**row, "verdict": case.calibration.verdict})
    return rows


def _run_stages(case: Case) -> Case:
    """The case after all stages except that of the task."""
    for stage in (*READING_STAGES, *SOLVING_STAGES, *JUDGING_STAGES[:-1]):
        if not case.is_ended:
            case = stage.run(case)
    return case


def _terms(case: Case, transform: str, columns: Array) -> Iterator[tuple[str, float]]:
    """Variance by term [m^2 or rad^2]."""
    fitted, as_modelled, final = case.answers
    weight = np.zeros(fitted.covariance.shape)
    weight[columns, columns] = 1.0

    def trace(covariance: Array) -> float:
        """Trace over the columns."""
        return float(np.trace(weight @ covariance))

    sources = {each.name: source_variance(fitted, weight, each) for each in error_sources(fitted.problem)}
    yield from sources.items()
    yield SHARED_SOURCE, max(trace(fitted.covariance) - sum(sources.values()), 0.0)
    contained = with_expected_sizes(case.cell, fitted, case.evidence.systematic_error).covariance - fitted.covariance
    yield CONTAINED, trace(contained)
    yield DETECTED, max(trace(as_modelled.covariance - fitted.covariance - contained), 0.0)
    yield CLOCKS, max(trace(final.covariance - as_modelled.covariance), 0.0)
    part = slice(0, 3) if columns[0] == fitted.problem.columns[transform].start else slice(3, 6)
    for gauge in held_gauges(final, [transform]):
        yield f"gauge of {gauge.robot}", float(np.trace(gauge.covariance[part, part]))


def section(result: Mapping[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    lines = [
        (
            name.removeprefix("real "),
            row["transform"],
            row["verdict"],
            f"{row['sigma']:.2g} {row['unit']}",
            _terms_text(row),
        )
        for name, rows in result["rows"].items()
        for row in rows
    ]
    about = "Each term is a part of the variance. The sigma is the 3-D norm."
    return f"{about}\n\n{table(HEAD, lines)}"


def _terms_text(row: Mapping[str, Any]) -> str:
    largest = list(row["shares"].items())[:LARGEST_TERMS]
    return ", ".join(f"{term} {100 * share:.0f}" for term, share in largest if share > 0.005)


def main(arguments: Sequence[str]) -> None:
    """Split and print; with all recordings write results/widths.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.widths", description=__doc__)
    parser.add_argument("--only", default="", metavar="PATTERN", help="recordings whose name matches")
    parser.add_argument("--keep", type=Path, help="file in which rows are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    names = [name for name in cases() if name.startswith("real ") and re.search(asked.only, name)]
    result = {"rows": {name: kept.of(name, lambda name=name: variance_rows(name)) for name in names}}
    print(section(result))
    if not asked.only:
        write("widths", result)


if __name__ == "__main__":
    main(sys.argv[1:])
