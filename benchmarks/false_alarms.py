"""How often the rules that compare models find something in a clean cell, all rules together.

The cells are the simulated cells of `benchmarks.reference`; joint offsets that are stated as fixed are zero. A false
alarm is a warning or an error that supports a wider or another model. Variances of errors that stops share do not
count as alarms and are counted separately, since they are chosen by a ratio of evidences. `--keep FILE` continues a
run.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

from basecal.accuracy.calibrate import calibrate
from basecal.simulation import Scenario, simulate
from benchmarks.common import run_cells, table
from benchmarks.reference.cases import scenario

CELLS, ASKED = 1000, 0.01
NO_RULE = {
    "unobservable-direction", "weak-direction", "prior-dominated", "too-few-samples", "not-validated", "overfit",
    "not-converged", "noise-not-identifiable", "outlier-samples", "outlier-points",
}  # fmt: skip
"""Codes that say how much the data determine, or which samples disagree: no other model is believed."""
SHARED = {"robot-model", "deflection"}
"""Codes of variances of errors that stops share, as an info."""


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """The verdict on a clean cell, and the codes of its warnings and errors."""
    drawn = scenario(seed)
    if drawn.get("joint_offsets") == "fixed":
        drawn["joint_offset_rad"] = 0.0
    simulated = simulate(Scenario(**drawn), seed)
    calibration = calibrate(simulated.cell, simulated.recording)
    codes = sorted({finding.code for finding in calibration.findings if finding.severity != "info"})
    shared = sorted({f.code for f in calibration.findings if f.severity == "info" and f.code in SHARED})
    yield {"seed": seed, "verdict": calibration.verdict, "codes": codes, "shared": shared}


def alarms(cells: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cells with a false alarm."""
    return [cell for cell in cells if set(cell["codes"]) - NO_RULE]


def format_result(cells: list[dict[str, Any]]) -> str:
    """A table of cells by code, and the rate."""
    counts = Counter(code for cell in cells for code in cell["codes"])
    rows = [(code, "no" if code in NO_RULE else "yes", count) for code, count in counts.most_common()]
    wrong = alarms(cells)
    seeds = f", of seeds {', '.join(str(cell['seed']) for cell in wrong)}" if wrong else ""
    rate = f"{len(wrong)} of {len(cells)} cells ({100 * len(wrong) / max(len(cells), 1):.1f} %)"
    taken = sum(bool(cell["shared"]) for cell in cells)
    shared = (
        f"In {taken} of {len(cells)} cells a variance of errors that stops share is estimated, and reported as an info."
    )
    return f"{table(('code', 'counts', 'cells'), rows)}\n\nFalse alarms: {rate}{seeds}.\n\n{shared}"


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
The simulated cells of `benchmarks.reference`, all of them free of faults, {result["cells"]} of {CELLS} so far. A
false alarm is a warning or an error that supports a wider or another model. Codes on how much the data determine, or
on samples that disagree, do not count. Required: at most {100 * result["asked"]:.0f} %, over all rules."""
    return f"{about}\n\n{format_result(result['rows'])}"


def make_result(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """The content of results/false_alarms.json."""
    return {"asked": ASKED, "cells": len(cells), "alarms": len(alarms(cells)), "rows": cells}


if __name__ == "__main__":
    run_cells("false_alarms", sys.argv[1:], CELLS, measure, format_result, make_result)
