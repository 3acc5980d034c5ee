"""How often a rule that compares models finds something in a clean cell, all rules together.

The simulated cells of `benchmarks.reference`, with joint offsets that are stated as fixed at zero. A false alarm is a
warning or an error that says that a wider or another model explains the data better. Variances of errors that stops
share are no alarms, and are counted apart: they are taken by a ratio of evidences. `--keep FILE` goes on with a run.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

from basecal.accuracy.calibrate import calibrate
from basecal.simulation import Scenario, simulate
from benchmarks.common import cell_by_cell, table
from benchmarks.reference.cases import scenario

CELLS, ASKED = 1000, 0.01
NO_RULE = {
    "unobservable-direction", "weak-direction", "prior-dominated", "too-few-samples", "not-validated", "overfit",
    "not-converged", "noise-not-identifiable", "outlier-samples", "outlier-points",
}  # fmt: skip
"""Codes that say how much the data determine, or which samples disagree: no other model is believed."""
SHARED = {"robot-model", "deflection"}
"""Codes of variances of errors that stops share, as an info."""


def measured(seed: int) -> Iterator[dict[str, Any]]:
    """The verdict on a clean cell, and the codes of its warnings and errors."""
    drawn = scenario(seed)
    if drawn.get("joint_offsets") == "fixed":
        drawn["joint_offset_rad"] = 0.0
    made = simulate(Scenario(**drawn), seed)
    found = calibrate(made.cell, made.recording)
    codes = sorted({finding.code for finding in found.findings if finding.severity != "info"})
    shared = sorted({f.code for f in found.findings if f.severity == "info" and f.code in SHARED})
    yield {"seed": seed, "verdict": found.verdict, "codes": codes, "shared": shared}


def alarms(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cells with a false alarm."""
    return [cell for cell in found if set(cell["codes"]) - NO_RULE]


def shown(found: list[dict[str, Any]]) -> str:
    """Cells by code, and the rate."""
    counts = Counter(code for cell in found for code in cell["codes"])
    rows = [(code, "no" if code in NO_RULE else "yes", count) for code, count in counts.most_common()]
    wrong = alarms(found)
    seeds = f", of seeds {', '.join(str(cell['seed']) for cell in wrong)}" if wrong else ""
    rate = f"{len(wrong)} of {len(found)} cells ({100 * len(wrong) / max(len(found), 1):.1f} %)"
    taken = sum(bool(cell["shared"]) for cell in found)
    shared = (
        f"In {taken} of {len(found)} cells a variance of errors that stops share is estimated, and reported as an info."
    )
    return f"{table(('code', 'counts', 'cells'), rows)}\n\nFalse alarms: {rate}{seeds}.\n\n{shared}"


def section(result: dict[str, Any]) -> str:
    """What the page says of a run."""
    about = f"""\
The simulated cells of `benchmarks.reference`, all of them free of faults, {result["cells"]} of {CELLS} so far. A
false alarm is a warning or an error that supports a wider or another model. Codes on how much the data determine, or
on samples that disagree, do not count. Required: at most {100 * result["asked"]:.0f} %, over all rules."""
    return f"{about}\n\n{shown(result['rows'])}"


def result(found: list[dict[str, Any]]) -> dict[str, Any]:
    """What is written."""
    return {"asked": ASKED, "cells": len(found), "alarms": len(alarms(found)), "rows": found}


if __name__ == "__main__":
    cell_by_cell("false_alarms", sys.argv[1:], CELLS, measured, shown, result)
