"""How well a capture knows its answer after each of its samples."""

from __future__ import annotations

from basecal.acquisition.watching import Snapshot
from basecal.reporting.decision.outlook import error_curve
from basecal.reporting.figures.figure import Figure


def progress_figure(snapshot: Snapshot) -> Figure | None:
    """The expected error at the task over samples with its tolerance, or else the base's sigma; None before two."""
    if len(snapshot.errors) > 1:
        return error_curve("expected error at the task, 95 %", snapshot.errors, snapshot.tolerance_m)
    sigmas = [(sigma.samples, sigma.t_m) for sigma in snapshot.sigmas]
    return error_curve("sigma of the base", sigmas, None) if len(sigmas) > 1 else None
