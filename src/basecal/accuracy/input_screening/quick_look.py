"""Quick check of imported data: whether the loops close as declared, and whether another convention fits better.

`benchmarks.slips` judges its limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.clocks.search import search_offsets
from basecal.accuracy.input_check.conventions import check_conventions
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit, fit_hypothesis, is_plausible
from basecal.accuracy.input_check.unexplained_motion import hopeless_finding, is_hopeless
from basecal.accuracy.input_screening.units import impossible_units
from basecal.accuracy.phrases.outlier import outlier_reason
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.accuracy.readings.scales import convert_units, estimate_units
from basecal.cell import Cell, Finding, Recording
from basecal.errors import BasecalError, sentence
from basecal.estimation.outliers.left_out import LeftOut
from basecal.estimation.outliers.noise_and_outliers import has_plausible_noise, with_noise
from basecal.estimation.outliers.robust_solve import solve_robustly
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import DEFAULT, STATED
from basecal.estimation.solve import solve_problem
from basecal.estimation.streams.streams import recording_streams
from basecal.numerics.batch import space_evenly

# Runs of consecutive samples are spread over the recording, since robots may take turns to move. Neighbours of a run
# keep only robot states, since images may be late by that many samples.
_RUN_COUNT = 3
_RUN_SAMPLES = 6
_NEIGHBOUR_COUNT = 2
_STREAM_VIEWS = 40  # views of streams, whose clock offsets are estimated, too
_FEW_SHARE = 0.2  # share of the samples that may disagree with all others
_UNEXPLAINED = "poor-fit"  # code of the finding that no convention explains the data
_FEWEST_SAMPLES = 5  # samples, below which conventions are not tested


@dataclass(frozen=True, eq=False)
class QuickLook:
    """Result of the quick check of a recording or a part of it.

    Attributes:
        views: Number of checked samples with a view.
        findings: Errors; for a whole recording, warnings, too.
        error: Prediction error of a view from the others, as text; None if it is not determined.
        undetermined: Reason why the conventions are not determined; empty if they are.
    """

    views: int
    findings: tuple[Finding, ...] = ()
    error: str | None = None
    undetermined: str = ""


def preview_samples(recording: Recording) -> Recording:
    """Samples for a quick check: runs spread over the recording, with the robot states of their neighbours."""
    samples = recording.samples
    views = [k for k, sample in enumerate(samples) if sample.observations or sample.images]
    if any(not samples[k].robots for k in views):  # streams: all robot states are needed
        omitted = set(views) - {views[k] for k in space_evenly(len(views), _STREAM_VIEWS)}
        return replace(recording, samples=tuple(s for k, s in enumerate(samples) if k not in omitted))
    if len(views) <= _RUN_COUNT * _RUN_SAMPLES:
        return recording
    starts = np.linspace(0, len(views) - _RUN_SAMPLES, _RUN_COUNT).astype(int)
    kept = {views[start + k] for start in starts for k in range(_RUN_SAMPLES)}
    near = sorted(
        {j for k in kept for j in range(k - _NEIGHBOUR_COUNT, k + _NEIGHBOUR_COUNT + 1)} & set(range(len(samples)))
    )
    few = (samples[k] if k in kept else replace(samples[k], observations=(), images={}, background={}) for k in near)
    return replace(recording, samples=tuple(few))


def quick_look(cell: Cell, recording: Recording, is_whole: bool = True) -> QuickLook:
    """Check whether a recording closes its loops under the declared conventions.

    Args:
        cell: The imported cell.
        recording: Samples chosen by `preview_samples`, with the detections of their images.
        is_whole: Whether these are all samples, so that no further data can resolve doubts.
    """
    try:
        streams = recording_streams(cell, recording)
        lenses = [camera.intrinsics for camera in cell.cameras.values() if camera.intrinsics is not None]
        if streams is not None and any(lens.status == "free" for lens in lenses):
            return QuickLook(0, undetermined="basecal calibrate determines clocks and an unknown lens jointly")
        samples = recording if streams is None else search_offsets(streams, DEFAULT).recording
        views = sum(bool(sample.observations) for sample in samples.samples)
        units_m, unit_findings = estimate_units(cell, samples)
        if unit_findings:
            is_certain = is_whole and views >= _FEWEST_SAMPLES
            return QuickLook(views, tuple(unit_findings) if is_certain else (), undetermined=unit_findings[0].what)
        samples = convert_units(samples, units_m)
        if unit_errors := impossible_units(cell, samples):
            return QuickLook(views, tuple(unit_errors))
        return _check_robustly(cell, samples, is_whole)
    except (BasecalError, np.linalg.LinAlgError) as error:
        return QuickLook(0, undetermined=str(error))


def _check_robustly(cell: Cell, recording: Recording, is_whole: bool) -> QuickLook:
    """Quick check of samples of one clock; repeated without a few outliers if these hide that the others agree.

    Raises:
        BasecalError: if the problem cannot be solved.
    """
    look = _check_samples(cell, recording, is_whole)
    if look.error is not None or look.views < _FEWEST_SAMPLES or any(f.code != _UNEXPLAINED for f in look.findings):
        return look
    outliers = _find_outliers(cell, recording)
    if not outliers:
        return look
    kept = tuple(sample for sample in recording.samples if sample.sample not in outliers)
    agreeing = _check_samples(cell, replace(recording, samples=kept), is_whole)
    if agreeing.error is None and not agreeing.findings:
        return look
    return replace(agreeing, findings=(*agreeing.findings, _outlier_finding(outliers)))


def _find_outliers(cell: Cell, recording: Recording) -> dict[int, LeftOut]:
    """A few samples that disagree with all others, by number; empty if they are many."""
    problem, _ = build_problem(cell, recording)
    left_out = solve_robustly(problem, cell, STATED).outliers
    found = {each.sample: each for each in left_out if not each.ids}
    return found if len(found) <= _FEW_SHARE * len(problem.samples) else {}


def _outlier_finding(outliers: dict[int, LeftOut]) -> Finding:
    numbers = sorted(outliers)
    what = f"{list_samples(numbers)} disagree{'s' if len(numbers) == 1 else ''} with all others"
    why = f"At sample {numbers[0]}, {outlier_reason(outliers[numbers[0]])}."
    do = "Look at the pose and the image there; `basecal calibrate` leaves out what disagrees."
    return Finding("outlier-samples", "warning", tuple(map(str, numbers)), sentence(what), (do,), why)


def _check_samples(cell: Cell, recording: Recording, is_whole: bool) -> QuickLook:
    """Quick check of all given samples.

    Raises:
        BasecalError: if the problem cannot be solved.
    """
    problem, _ = build_problem(cell, recording)
    views = len(problem.samples)
    if views < _FEWEST_SAMPLES:
        return QuickLook(views, undetermined=f"{_FEWEST_SAMPLES} with the robots' poses are needed")
    solution = solve_problem(problem, cell, STATED)
    is_explained = has_plausible_noise(with_noise(solution, DEFAULT))
    findings = check_conventions(cell, recording, problem, solution, STATED, is_explained)
    if grave := tuple(f for f in findings if f.severity == "error" or (is_whole and f.severity == "warning")):
        return QuickLook(views, grave)
    if is_hopeless(solution.problem, solution.state):
        return QuickLook(views, (hopeless_finding(solution.problem, solution.state),))
    fit = fit_hypothesis(cell, problem, STATED, solution.state)
    if fit is None or any(name in solution.observability.unobservable for name in cell.requested_transforms):
        return QuickLook(views, undetermined=_describe_ambiguity(cell, fit))
    if not is_plausible(fit):
        return QuickLook(
            views,
            undetermined=f"held-out views have an error of {fit.error_in_words()}, and no other convention reduces it",
        )
    return QuickLook(views, error=fit.error_in_words())


def _describe_ambiguity(cell: Cell, fit: HypothesisFit | None) -> str:
    """Text on undetermined transforms; free joint offsets couple with a base whatever the robots do."""
    fitted = "" if fit is None else f"as declared the views fit with an error of {fit.error_in_words()}, but "
    has_parameters = any(robot.parameters for robot in cell.robots.values())
    what = "without the priors of its robots" if has_parameters else "; rotate every arm about two axes or more"
    return f"{fitted}the requested transforms are not determined{' ' if has_parameters else ''}{what}"
