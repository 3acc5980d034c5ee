"""Correction of a solution by the remaining step of the clock offsets, with the offsets' uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.clocks.search import ClockedRecording
from basecal.accuracy.clocks.step import ClockStep, clock_step
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import ClockOffset, Finding, LineTime
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.solve import Solution
from basecal.estimation.streams.rolling_shutter import line_time_name


def remaining_step(recording: ClockedRecording, solution: Solution) -> ClockStep:
    """Return the remaining step of the clock offsets at the final solution, which has its own inliers and noise."""
    return clock_step(recording.streams, recording.synchronised, recording.offsets_s, solution)


def apply_remaining_step(solution: Solution, step: ClockStep) -> Solution:
    """Move a solution to the optimum of the clock offsets, to first order, and add the offsets' uncertainty.

    The covariance is C + G V G'. C is the covariance for known offsets, G the derivative of the solution with respect
    to the offsets, and V the covariance of the offsets. Source: docs/mathematics.md (12.3).
    """
    normal = linearise(solution.problem, solution.state)
    state = retract(solution.problem, solution.state, normal, step.by_offsets @ step.step_s)
    covariance = solution.covariance + step.by_offsets @ step.covariance @ step.by_offsets.T
    return replace(solution, state=state, covariance=covariance)


def clock_offsets(recording: ClockedRecording, step: ClockStep) -> dict[str, ClockOffset]:
    """Clock offsets by device: those that were estimated and are observable, and those stated other than 0."""
    lines = {line_time_name(camera) for camera in recording.streams.cell.cameras}
    found = _estimated_offsets(recording, step)
    return {name: ClockOffset(*value) for name, value in found.items() if name not in lines}


def line_times(recording: ClockedRecording, step: ClockStep) -> dict[str, LineTime]:
    """Line times by camera: those that were estimated and are observable, and those stated other than 0."""
    found = _estimated_offsets(recording, step)
    return {
        name: LineTime(*found[line_time_name(name)])
        for name in recording.streams.cell.cameras
        if line_time_name(name) in found
    }


def _estimated_offsets(recording: ClockedRecording, step: ClockStep) -> dict[str, tuple[float, float]]:
    """Offsets with sigmas [s] by device, and line times with sigmas [s] by `line_time_name`."""
    found = {name: (offset, 0.0) for name, offset in recording.offsets_s.items() if offset}
    for k, name in enumerate(step.clocks):
        found.pop(name, None)
        if step.is_observable[k]:
            found[name] = (recording.offsets_s[name] + float(step.step_s[k]), float(np.sqrt(step.covariance[k, k])))
    return found


def clock_findings(recording: ClockedRecording, step: ClockStep) -> list[Finding]:
    """Findings about the estimated clocks and line times."""
    findings = []
    cameras = {line_time_name(camera): camera for camera in recording.streams.cell.cameras}
    for k, name in enumerate(step.clocks):
        known = recording.streams.clocks[name]
        offset = recording.offsets_s[name] + float(step.step_s[k])
        deviation_s = offset - known.offset_s
        device, is_line = cameras.get(name, name), name in cameras
        which = f"The line time of {device}" if is_line else f"The clock of {device}"
        if not step.is_observable[k]:
            kept = f"{1e6 * recording.offsets_s[name]:.1f} us" if is_line else f"{recording.offsets_s[name]:.3f} s"
            why = (
                f"The robots move too little while it records. The value {kept} is kept, without effect on the result."
            )
            findings.append(Finding("unobservable-direction", "info", (device,), f"{which} is unobservable.", why=why))
        elif known.sigma_s is not None and compare_nested_models((deviation_s / known.sigma_s) ** 2, 1).is_taken:
            estimated = f"{1e6 * offset:.2f} us" if is_line else f"{1e3 * offset:.1f} ms off"
            stated = f"{1e6 * known.offset_s:.2f} us" if is_line else f"{1e3 * known.offset_s:.1f} ms"
            what = f"{which} is {estimated}, {abs(deviation_s) / known.sigma_s:.1f} sigma from its prior of {stated}."
            kind, value = ("rolling_shutter", "line_time_s") if is_line else ("clock", "offset_s")
            entry = f"`{kind}: {{status: free, {value}: {offset:.3g}}}`"
            do = (f"Check the prior, or write {entry} at {device} in cell.yaml.",)
            findings.append(Finding("prior-contradicted", "warning", (device,), what, do))
    return findings
