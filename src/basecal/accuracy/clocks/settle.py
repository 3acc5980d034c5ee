"""An answer with its clocks: moved by what is left of their offsets, and as wide as these leave it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.clocks.search import Clocked
from basecal.accuracy.clocks.step import ClockStep, clock_step
from basecal.cell import ClockOffset, Finding
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.solve import Solution

_PULLED = 4.0  # sigmas of its prior by which an offset contradicts it, as for all priors


def clocks_left(clocked: Clocked, solution: Solution) -> ClockStep:
    """The step that the answer, made of what agrees and with its noise, still asks of the clocks."""
    return clock_step(clocked.streams, clocked.synchronised, clocked.offsets_s, solution)


def settled(solution: Solution, left: ClockStep) -> Solution:
    """The answer at the optimum of the offsets, to first order, and its covariance with theirs.

    With C the covariance where the offsets are known, G how the answer goes with them, and V their own covariance, it
    is C + G V G'. Source: docs/mathematics.md (12.3).
    """
    normal = linearise(solution.problem, solution.state)
    state = retract(solution.problem, solution.state, normal, left.by_offsets @ left.step_s)
    covariance = solution.covariance + left.by_offsets @ left.covariance @ left.by_offsets.T
    return replace(solution, state=state, covariance=covariance)


def clock_offsets(clocked: Clocked, left: ClockStep) -> dict[str, ClockOffset]:
    """Offsets by device, of those that were estimated and seen, or stated and not 0."""
    found = {name: ClockOffset(clocked.offsets_s[name], 0.0) for name in clocked.offsets_s if clocked.offsets_s[name]}
    for k, name in enumerate(left.clocks):
        found.pop(name, None)
        if left.seen[k]:
            offset = clocked.offsets_s[name] + float(left.step_s[k])
            found[name] = ClockOffset(offset, float(np.sqrt(left.covariance[k, k])))
    return found


def clock_findings(clocked: Clocked, left: ClockStep) -> list[Finding]:
    """What is to be said of the clocks that were estimated."""
    findings = []
    for k, name in enumerate(left.clocks):
        known = clocked.streams.clocks[name]
        offset = clocked.offsets_s[name] + float(left.step_s[k])
        if not left.seen[k]:
            held = f"it is held at {clocked.offsets_s[name]:.3f} s, and nothing depends on it"
            words = f"the clock of {name} is unobservable, since nothing moves enough while it records: {held}"
            findings.append(Finding("unobservable-direction", "info", (name,), words))
        elif known.sigma_s is not None and abs(offset - known.offset_s) > _PULLED * known.sigma_s:
            sigmas = abs(offset - known.offset_s) / known.sigma_s
            words = (
                f"the clock of {name} is {1e3 * offset:.1f} ms off, {sigmas:.1f} sigma from its prior of "
                f"{1e3 * known.offset_s:.1f} ms: check the prior, or set its status to free"
            )
            findings.append(Finding("prior-contradicted", "warning", (name,), words))
    return findings
