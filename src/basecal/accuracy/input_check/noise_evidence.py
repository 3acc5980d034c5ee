"""Whether the data ask for a wider hypothesis where arms and cameras have the noise that they may have.

With robots assumed exact, predictions improve whenever a further unknown compensates some of the arms' errors, most of
all with few samples. With noise estimated beside both hypotheses, the gain in likelihood shows whether there is more to
it.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.model_comparison.comparison import Comparison
from basecal.accuracy.model_comparison.nested_models import CONFIRMED, compare_nested_models
from basecal.estimation.noise.view_estimates import STATED, view_estimates
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode
from basecal.estimation.view.points import PointMeasurement
from basecal.numerics.spectral import spectrum


def noise_evidence(fit: HypothesisFit, baseline: HypothesisFit) -> Comparison | None:
    """The evidence of the data for a hypothesis that has the declared one as a special case.

    For a size two likelihoods are compared: of the views' poses, and of how points in space scatter about these. Points
    in space have a size of their own, while pixels of a target of any size scatter equally. The search for the
    hypothesis' noise starts from the declared one's. If both the arms and the images may be off, two noises explain
    the views. A gain of one over the other is then no gain of the hypothesis.

    For a lens or a transform that is freed, the evidence is its squared distance from the stated one, in sigmas.
    Likelihoods are not compared in this case. Views that estimate their own lens hold more than those that do not, and
    restricted likelihoods of different unknowns are not comparable.

    Args:
        fit: The hypothesis' fit.
        baseline: That of the declared one.

    Returns:
        None if the two rest on different views.
    """
    if _views(fit.solution) != _views(baseline.solution):
        return None
    noisy = Settings(robot_noise="estimated")
    narrower = solve_at_mode(baseline.solution.problem, baseline.solution.state, noisy)
    wider = solve_at_mode(fit.solution.problem, fit.solution.state, noisy, guess=narrower.noise)
    freed = [name for name in wider.problem.columns if name not in narrower.problem.columns]
    if not freed:
        gain = narrower.noise.minus_2_log_evidence - wider.noise.minus_2_log_evidence + _scatter_gain(wider, narrower)
        return compare_nested_models("size", gain, 1, CONFIRMED)
    off = [_distance(wider, narrower.state, name) for name in freed]
    gain = sum(square for square, _ in off)
    return compare_nested_models("freed", gain, sum(count for _, count in off), CONFIRMED)


def _views(solution: Solution) -> int:
    return sum(map(len, solution.problem.groups))


def _scatter_gain(wider: Solution, narrower: Solution) -> float:
    """Twice the log ratio of likelihoods of points in space about their view's pose; by their scatter if unstated."""
    gain, more = 0.0, _scatter(narrower)
    for name, (less, freedoms) in _scatter(wider).items():
        if name == STATED:
            gain += more[name][0] - less
        elif less > 0 and more[name][0] > 0:
            gain += freedoms * float(np.log(more[name][0] / less))
    return gain


def _scatter(solution: Solution) -> dict[str, tuple[float, float]]:
    """Squares of points in space about their view's own pose at unit sigma, and freedoms, by field of `Noise`."""
    found: dict[str, tuple[float, float]] = {}
    for group in (g for g in solution.problem.groups if isinstance(g.measurement, PointMeasurement)):
        for name, view in view_estimates(solution.problem, group, solution.state).items():
            squares, freedoms = found.get(name, (0.0, 0.0))
            found[name] = squares + view.white, freedoms + view.white_count
    return found


def _distance(solution: Solution, stated_state: State, name: str) -> tuple[float, int]:
    """Squared distance of an estimated lens or transform from the stated one, in sigmas, and its freedoms."""
    where = solution.problem.columns[name]
    if name in stated_state.cameras:
        found = solution.state.cameras[name].parameters
        stated = stated_state.cameras[name].parameters
        step = found - np.pad(stated, (0, len(found) - len(stated)))
    else:
        step = (stated_state.transforms[name].inverse() @ solution.state.transforms[name]).log()[
            : where.stop - where.start
        ]
    known = spectrum(solution.covariance[where, where])
    return float(known.squared_mahalanobis(step)), int(known.rank)
