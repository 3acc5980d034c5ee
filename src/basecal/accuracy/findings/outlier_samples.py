"""`outlier-samples`: outlier views, samples that mostly disagree, and stops with large pose errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.changed_frame import ChangedFrame, changed_frame
from basecal.accuracy.phrases.outlier import list_outliers
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Finding
from basecal.errors import sentence
from basecal.estimation.outliers.left_out import LeftOut
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array, IntArray

FEW_SHARE = 0.03
"""Share of the samples up to which outliers are single events rather than a fault of the cell; assumed."""

_FAR_SIGMAS = 6.0  # sigmas of a stop's error: a normal variable exceeds it with a probability of 2e-9
_FEWEST_MOVED = 3  # samples at an end of the recording: two may be single outliers; assumed


def outlier_samples(evidence: Evidence) -> list[Finding]:
    """A finding about samples with an outlier view; a warning above 3 % of samples."""
    outliers = [o for o in evidence.robust.outliers if not o.ids]
    numbers, total = sorted({o.sample for o in outliers}), evidence.robust.samples
    if not numbers:
        return []
    is_single = len(numbers) == 1
    outlier = "an outlier" if is_single else "outliers"
    what = f"{list_samples(numbers)} ({len(numbers)} of {total}) {'was' if is_single else 'were'} left out as {outlier}"
    why = list_outliers(outliers, evidence.images)
    causes = outlier_causes(evidence.recorded, evidence.solution.state, numbers)
    moved = f" {' '.join(causes)}" if causes else _moved_sentence(outliers, evidence.robust.solution.problem)
    them = "it" if is_single else "them"
    do = f"Look at {them} (samples count from 0), and record with arms at rest."
    about = tuple(map(str, numbers))
    cure = f"`basecal fix CELL` removes {them} from the recording."
    return [
        Finding(
            "outlier-samples",
            "warning" if len(numbers) > FEW_SHARE * total else "info",
            about,
            sentence(what),
            (do, cure),
            f"{why}{moved}",
        )
    ]


def _moved_sentence(outliers: Sequence[LeftOut], inliers: Problem) -> str:
    """Likely cause of outliers that are all views of one frame after or before a sample; else an empty text."""
    views = {(o.camera, o.target) for o in outliers}
    groups = [group for group in inliers.groups if (group.camera, group.target) in views]
    frames = [
        name
        for name in dict.fromkeys(name for g in groups for name in g.frames)
        if all(name in group.frames for group in groups)
    ]
    kept = {name: [int(n) for g in inliers.groups if name in g.frames for n in g.sample] for name in frames}
    numbers = sorted({o.sample for o in outliers})
    if len(numbers) < _FEWEST_MOVED or not kept or not all(kept.values()):
        return ""
    fewest = min(kept, key=lambda name: len(kept[name]))
    first, last = min(kept[fewest]), max(kept[fewest])
    moved = [name for name in kept if len(kept[name]) == len(kept[fewest])]
    what = fewest.rpartition("_from_")[2] if len(moved) == 1 else "a base, a mount or the target"
    if numbers[0] > last:
        return (
            f" The outliers look as if {what} was moved{_distance_phrase(outliers)} after sample {last}; "
            "the answer is for the samples before."
        )
    if numbers[-1] < first:
        verb_phrase = f"was elsewhere{_distance_phrase(outliers)}"
        return (
            f" The outliers look as if {what} {verb_phrase} before sample {first}; the answer is for the samples after."
        )
    return ""


def _distance_phrase(outliers: Sequence[LeftOut]) -> str:
    """Median distance of single points from their prediction, as text; empty if not all outliers are points."""
    known = [o.off_m for o in outliers if o.off_m is not None and o.off_rad is None]
    return f" by {1e3 * float(np.median(known)):.1f} mm" if len(known) == len(outliers) else ""


def agreeing_samples(evidence: Evidence) -> list[Finding]:
    """A warning if no solution explains most samples, with those that agree with one another."""
    robust = evidence.robust
    changed = changed_frame(evidence.recorded, evidence.cell) if robust.agreeing else None
    return agreement_findings(robust, changed)


def agreement_findings(robust: RobustSolution, change: ChangedFrame | None) -> list[Finding]:
    """A warning that few samples of a solution agree, with the frame that changed between samples, if it is known."""
    numbers = sorted(robust.agreeing if change is None else change.agreeing)
    if not numbers:
        return []
    what = f"Of {robust.samples} samples only {len(numbers)} agree with one another: {list_samples(numbers)}."
    cause = "" if change is None else change.sentence
    why = f"{cause} Nothing was left out, and the answer is not to be trusted.".lstrip()
    do = ["Check how poses and views were paired.", "Check whether a robot or a mount was moved between the samples."]
    if cause:
        do = ["Import the samples from there on into a cell of their own, or record them again."]
    return [Finding("outlier-samples", "warning", tuple(map(str, numbers)), what, tuple(do), why)]


def far_stops(evidence: Evidence) -> list[Finding]:
    """A warning about stops with a pose error of more than six sigma, if no other finding is about samples."""
    solution = evidence.robust.solution
    errors = np.abs(solution.state.stop_errors).max(axis=1)
    far = np.flatnonzero(errors > _FAR_SIGMAS)
    ends = [(group, end) for group in solution.problem.groups for end in group.ends]
    samples = sorted({int(number) for group, end in ends for number in group.sample[np.isin(end.stop, far)]})
    if not samples or evidence.robust.agreeing or any(not o.ids for o in evidence.robust.outliers):
        return []
    what = f"A robot's pose was off by up to {errors.max():.0f} of its sigmas at {list_samples(samples)}."
    why, do = "The arm had not settled, or was bumped.", ("Leave these samples out, or state a larger noise.",)
    return [Finding("outlier-samples", "warning", tuple(map(str, samples)), what, do, why)]


# Times the worst residual of the inliers, since the fit excluded the row; tested by slips 9 and 20 of `benchmarks`.
_RESIDUAL_RATIO = 3.0
_MOST_OUTLIERS = 12  # outliers whose pairs are tried; assumed: bounds the time
# Factors to metres from the unit in which a row may have been written, by definition.
_UNITS = {"millimetres": 1e-3, "metres among millimetres": 1e3}


def outlier_causes(problem: Problem, state: State, numbers: Sequence[int]) -> list[str]:
    """Sentences about mistakes in robot rows that explain outlier views about as well as the inliers.

    Args:
        problem: The recorded problem, including outliers.
        state: State of the answer without outliers.
        numbers: Numbers of the samples with outliers.
    """
    return list(dict.fromkeys(_row_mistakes(problem, state, numbers)))


def _row_mistakes(problem: Problem, state: State, numbers: Sequence[int]) -> Iterator[str]:
    """Sentences as `outlier_causes`, repeated for each group of views that shows the mistake."""
    for group in problem.groups:
        bare, of_outliers = group.without_stops(), np.isin(group.sample, list(numbers))
        rows = np.flatnonzero(of_outliers)
        if not 0 < len(rows) <= _MOST_OUTLIERS or len(rows) == len(group):
            continue
        limit = _RESIDUAL_RATIO**2 * float(_costs(problem, state, bare)[~of_outliers].max())
        for robot in group.robots:
            yield from _exchanged_rows(problem, state, bare, limit, robot, rows)
            pose = _recorded_poses(bare, robot)
            for unit, factor in _UNITS.items():
                scaled = _with_poses(bare, robot, SE3(pose.rotation, factor * pose.translation))
                fits = rows[_costs(problem, state, scaled)[rows] <= limit]
                if len(fits):
                    subject = f"pose of {robot} at" if len(fits) == 1 else f"poses of {robot} at"
                    looks = f"look{'s' if len(fits) == 1 else ''} like {unit}"
                    yield f"The {subject} {list_samples(group.sample[fits].tolist())} {looks}."


def _exchanged_rows(
    problem: Problem, state: State, group: ViewGroup, limit: float, robot: str, rows: IntArray
) -> Iterator[str]:
    pose = _recorded_poses(group, robot)
    for first, second in combinations(rows.tolist(), 2):
        order = np.arange(len(group))
        order[[first, second]] = second, first
        exchanged = _with_poses(group, robot, pose[order]).take(np.array([first, second]))
        if np.all(_costs(problem, state, exchanged) <= limit):
            both = " and ".join(map(str, sorted(group.sample[[first, second]].tolist())))
            yield f"The poses of {robot} at samples {both} are exchanged."


def _recorded_poses(group: ViewGroup, robot: str) -> SE3:
    end = group.robot_end(robot)
    assert end is not None
    return end.base_from_flange


def _with_poses(group: ViewGroup, robot: str, pose: SE3) -> ViewGroup:
    return group.with_ends(lambda end: replace(end, base_from_flange=pose, joints=None) if end.robot == robot else end)


def _costs(problem: Problem, state: State, group: ViewGroup) -> Array:
    """Squared residuals of each view in sigmas, (n,); infinite if the view is impossible."""
    predicted = state.camera_from_target(group, problem.stops)
    cost = group.measurement.linearise(predicted, state.cameras.get(group.camera), False).cost
    return np.nan_to_num(cost, nan=np.inf)
