"""What was left out of a solution, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Finding, Outlier
from basecal.cell.calibration import Severity
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.problem import Problem
from basecal.geometry import IntArray

# A sample that had to go is an event in the cell; a point is the detector's everyday business.
_FEW_SAMPLES = 0.03
_FEW_POINTS = 0.1
_OUTLIER_SIGMAS = 6.0
_SHOWN = 10
_FEWEST_MOVED = 3


def outlier_findings(robust: RobustSolution) -> list[Finding]:
    """Findings about samples and points that were left out, and about robots that were off all the same."""
    whole = [o for o in robust.outliers if not o.ids]
    points = [o for o in robust.outliers if o.ids]
    return _samples(whole, robust) + _points(points, robust) + _agreeing(robust) + _far_stops(robust, bool(whole))


def _samples(outliers: Sequence[Outlier], robust: RobustSolution) -> list[Finding]:
    numbers = sorted({o.sample for o in outliers})
    if not numbers:
        return []
    message = (
        f"{_listed(numbers)} {_of(len(numbers), robust.samples)} left out, since what {_they(numbers)} "
        f"does not agree with the others; {_example(outliers)}; {_moved(numbers, robust) or _look(numbers)}"
    )
    return [
        Finding(
            "outlier-samples", _severity(len(numbers), robust.samples, _FEW_SAMPLES), tuple(map(str, numbers)), message
        )
    ]


def _look(numbers: Sequence[int]) -> str:
    return f"look at {_it(numbers)}, and record with arms at rest"


def _moved(numbers: Sequence[int], robust: RobustSolution) -> str:
    """What it means that all from one sample on, or all up to one, were left out; nothing where they are others."""
    kept = [int(number) for group in robust.solution.problem.groups for number in group.sample]
    if len(numbers) < _FEWEST_MOVED or not kept:
        return ""
    first, last = min(kept), max(kept)
    if numbers[0] > last:
        return f"as if after sample {last} a base, a mount or the target had been moved: the answer is of before"
    if numbers[-1] < first:
        return f"as if before sample {first} a base, a mount or the target had stood elsewhere: the answer is of after"
    return ""


def _points(outliers: Sequence[Outlier], robust: RobustSolution) -> list[Finding]:
    count = sum(len(o.ids) for o in outliers)
    if not count:
        return []
    numbers = sorted({o.sample for o in outliers})
    message = (
        f"{count} of {robust.points + count} points were left out, in {_listed(numbers)}; {_example(outliers)}; "
        "look for reflections, covered or blurred parts of the target, and ids of another target"
    )
    return [
        Finding(
            "outlier-points", _severity(count, robust.points + count, _FEW_POINTS), tuple(map(str, numbers)), message
        )
    ]


def _agreeing(robust: RobustSolution) -> list[Finding]:
    """Where no answer rests on most samples: which of them agree with one another."""
    if not robust.agreeing:
        return []
    numbers = sorted(robust.agreeing)
    message = (
        f"of {robust.samples} samples only {len(numbers)} close the loop with one another, {_listed(numbers)}, and the "
        "others do not: nothing was left out, and the answer is not to be trusted; check how poses and views were "
        "paired, and whether a robot or a mount was moved between the samples"
    )
    about = tuple(map(str, numbers))
    return [Finding("outlier-samples", "warning", about, message)]


def _far_stops(robust: RobustSolution, told: bool) -> list[Finding]:
    """Stops whose pose error is more than six sigma in a direction: a chance of 2e-9 each where the noise is true."""
    solution = robust.solution
    errors = np.abs(solution.state.stop_errors).max(axis=-1, initial=0.0)
    samples = sorted(_samples_at(solution.problem, np.flatnonzero(errors > _OUTLIER_SIGMAS)))
    if not samples or told:
        return []
    message = (
        f"a robot was off by up to {errors.max():.0f} of its stated sigmas at {_listed(samples)}: taken before the arm "
        "settled, or bumped; leave these samples out, or state a larger noise"
    )
    return [Finding("outlier-samples", "warning", tuple(map(str, samples)), message)]


def _samples_at(problem: Problem, stops: IntArray) -> set[int]:
    """Numbers of the samples that stand in these stops."""
    return {
        int(number)
        for group in problem.groups
        for stop in (group.eye_stop, group.hand_stop)
        for number in group.sample[np.isin(stop, stops)]
    }


def _severity(lost: int, total: int, few: float) -> Severity:
    return "warning" if lost > few * total else "info"


def _listed(numbers: Sequence[int]) -> str:
    shown = ", ".join(_ranges(numbers)[:_SHOWN]) + (", ..." if len(_ranges(numbers)) > _SHOWN else "")
    return f"sample {shown}" if len(numbers) == 1 else f"samples {shown}"


def _ranges(numbers: Sequence[int]) -> list[str]:
    """Numbers in order, three and more in a row as first to last."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return [text for run in runs for text in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run))]


def _of(count: int, total: int) -> str:
    return f"({count} of {total}) {'was' if count == 1 else 'were'}"


def _they(numbers: Sequence[int]) -> str:
    return "it shows" if len(numbers) == 1 else "they show"


def _it(numbers: Sequence[int]) -> str:
    return "it" if len(numbers) == 1 else "them"


def _example(outliers: Sequence[Outlier]) -> str:
    first = outliers[0]
    return f"at sample {first.sample} {first.reason}"
