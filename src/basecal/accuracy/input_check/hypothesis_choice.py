"""Choice of the fitted hypotheses to report: those that predict better, or equally well with another answer.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.input_check.hypotheses import ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit, is_near, is_plausible
from basecal.accuracy.model_comparison.held_out import CLEAR_RATIO, compare_predictions
from basecal.accuracy.model_comparison.nested_models import CONFIRMED_LEVEL, Comparison, Decision, compare_nested_models
from basecal.cell import Cell, Finding
from basecal.cell.calibration import Severity
from basecal.effects import fixed_transform
from basecal.effects.faces.effect import FIX
from basecal.errors import sentence
from basecal.estimation.noise.estimate import ROUNDING
from basecal.estimation.noise.view_estimates import STATED, view_estimates
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode
from basecal.estimation.view.points import PointMeasurement
from basecal.fields.digits import two_digits
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import spectrum

_CERTAIN_GAIN = 100.0  # twice a log likelihood ratio: true sizes gain up to 40 if the robots have errors of their own
_TAIL_RATIO = 2.0  # rms of all samples over that of most, which chance does not reach
_DIFFERENT_SIGMAS = 3.0  # sigmas between two answers that count as different
# A wider model absorbs some of the errors of robots and lenses: below this likelihood ratio it found no mistake.
_WIDER_RATIO = 2.0


@dataclass(frozen=True, eq=False)
class TriedHypothesis:
    """A hypothesis with its fit.

    Attributes:
        hypothesis: The hypothesis.
        fit: Its fit.
        impossible: Implausible quantities under the hypothesis, as text.
    """

    hypothesis: ConventionHypothesis
    fit: HypothesisFit
    impossible: tuple[str, ...]

    def compare(self, baseline: HypothesisFit) -> Comparison:
        """Compare its predictions with those of the declared hypothesis, for the samples of both."""
        clear_ratio = _WIDER_RATIO if self.hypothesis.is_wider else CLEAR_RATIO
        shared = np.intersect1d(self.fit.sample, baseline.sample)
        return compare_predictions(self.fit.squares(shared), baseline.squares(shared), clear_ratio)


def has_tail(fit: HypothesisFit) -> bool:
    """Whether some samples have far larger prediction errors than most."""
    return bool(np.isfinite(fit.trimmed_rms) and fit.rms > _TAIL_RATIO * fit.trimmed_rms)


def is_observable(cell: Cell, fit: HypothesisFit) -> bool:
    """Whether a fit determines all requested transforms."""
    return not any(name in fit.solution.observability.unobservable for name in cell.requested_transforms)


def decide_hypotheses(
    cell: Cell,
    baseline: TriedHypothesis,
    trials: Sequence[TriedHypothesis],
    is_explained: bool,
    still_robots: frozenset[str],
) -> tuple[Finding, ...]:
    """Findings about the hypotheses that are more plausible than the declared one, or equally plausible.

    Args:
        cell: The declared cell.
        baseline: The declared hypothesis.
        trials: Alternative hypotheses.
        is_explained: Whether typical robot noise explains the residuals of robots that were assumed exact.
        still_robots: Robots that never move.
    """
    possible = [t for t in trials if not t.impossible and is_observable(cell, t.fit) and is_plausible(t.fit)]
    winning = _confirm_against_noise([t for t in possible if _wins(cell, t, baseline)], baseline, is_explained)
    if winning:
        best = min(winning, key=lambda w: w[0].fit.trimmed_rms * w[0].fit.rms)[0]
        as_good = [(t, certain) for t, certain in winning if _is_as_good(t, best.fit)]
        # Values stated by hand are doubted before data from devices.
        stated = [each for each in as_good if each[0].hypothesis.code == fixed_transform.CODE]
        return tuple(dict.fromkeys(_make_finding(cell, t, baseline, certain) for t, certain in stated or as_good))
    if not is_plausible(baseline.fit):
        what = f"The pose consistency error is {baseline.fit.error_in_words()}."
        why = "No other convention of the input that was tried is consistent."
        do = ("Look at the samples with the largest residuals, and at what the frames mean.",)
        is_of_noise = baseline.fit.in_pixels or (is_explained and is_near(baseline.fit))  # which is judged later
        return () if is_of_noise else (Finding("poor-fit", "warning", (), what, do, why),)
    if not is_observable(cell, baseline.fit):
        return ()
    rivals = [
        t
        for t in possible
        if not t.hypothesis.is_wider
        and _is_as_good(t, baseline.fit)
        and _moves_answer(cell, t, baseline.fit, baseline.fit)
    ]
    # The base of a robot that never moves compensates any change of its one pose: no data can distinguish them.
    of_still = [t for t in rivals if set(t.hypothesis.about) <= still_robots]
    others = [t for t in rivals if t not in of_still]
    kinds: tuple[tuple[Severity, list[TriedHypothesis]], ...] = (("warning", others), ("info", of_still))
    return tuple(_ambiguity_finding(cell, baseline, similar, severity) for severity, similar in kinds if similar)


def _is_as_good(trial: TriedHypothesis, reference: HypothesisFit) -> bool:
    return trial.compare(reference).decision is not Decision.KEEP


def _wins(cell: Cell, trial: TriedHypothesis, baseline: TriedHypothesis) -> bool:
    """Whether a hypothesis is more plausible than the declared one."""
    compared = trial.compare(baseline.fit)
    if baseline.impossible and compared.decision is not Decision.KEEP and not trial.hypothesis.is_wider:
        return True
    is_other = (
        trial.hypothesis.is_wider
        or not is_plausible(baseline.fit)
        or _moves_answer(cell, trial, baseline.fit, trial.fit)
    )
    return compared.is_taken and is_other


def _moves_answer(cell: Cell, trial: TriedHypothesis, baseline: HypothesisFit, scale: HypothesisFit) -> bool:
    """Whether a hypothesis moves the requested transforms by more than three sigmas of `scale`, or has other ones."""
    ignored = cell.mount_name(trial.hypothesis.about[0]) if trial.hypothesis.code == "board-symmetry" else None
    for name in cell.requested_transforms:
        if name == ignored and cell.transforms[name].status == "free":
            continue
        if name not in trial.fit.solution.state.transforms:  # the mount of a target with another carrier
            return True
        off = np.abs(_difference(baseline, trial.fit, name).log())
        sigma = np.sqrt(np.maximum(np.diag(scale.solution.joint_transform_covariance([name])), 0.0))
        if np.any(off > _DIFFERENT_SIGMAS * np.maximum(sigma, ROUNDING)):
            return True
    return False


def _difference(fit: HypothesisFit, rival: HypothesisFit, name: str) -> SE3:
    return fit.solution.state.transforms[name].inverse() @ rival.solution.state.transforms[name]


def _confirm_against_noise(
    winning: Sequence[TriedHypothesis], baseline: TriedHypothesis, is_explained: bool
) -> list[tuple[TriedHypothesis, bool]]:
    """Hypotheses that the data support even with robot noise, and whether each is certain."""
    found = []
    for tried in winning:
        if not tried.hypothesis.is_wider or not (is_explained or is_plausible(baseline.fit)):
            found.append((tried, True))
            continue
        evidence = noise_evidence(tried.fit, baseline.fit)
        if evidence is None or evidence.is_taken:
            found.append((tried, evidence is not None and evidence.gain > _CERTAIN_GAIN))
    return found


def _make_finding(cell: Cell, trial: TriedHypothesis, baseline: TriedHypothesis, certain: bool) -> Finding:
    hypothesis = trial.hypothesis
    if trial.compare(baseline.fit).is_taken:
        errors = f"{trial.fit.error_in_words()} instead of {baseline.fit.error_in_words()}"
        why = f"Under this hypothesis the cross-validation error is {errors}."
    else:
        faults = " and ".join(baseline.impossible)
        why = f"The declared convention fits equally well, but gives an implausible answer: {faults}."
    what = sentence(hypothesis.words, hypothesis.about)
    do: tuple[str, ...] = (sentence(hypothesis.fix), FIX)
    if hypothesis.code == fixed_transform.CODE:
        (name,) = hypothesis.about
        stated, estimate = cell.transforms[name].mean, trial.fit.solution.transforms[name]
        assert stated is not None
        what, do = fixed_transform.disagreement(name, (stated.inverse() @ estimate.mean).log(), estimate.covariance)
    return Finding(hypothesis.code, "error" if certain else "warning", hypothesis.about, what, do, why)


def _ambiguity_finding(
    cell: Cell, baseline: TriedHypothesis, rivals: Sequence[TriedHypothesis], severity: Severity
) -> Finding:
    """One finding for all hypotheses that fit as well as the declared one."""
    name = cell.requested_transforms[0]
    listed = " or ".join(
        f"{t.hypothesis.words} ({t.hypothesis.code}: {t.fit.error_in_words()}{_distance_clause(baseline, t, name)})"
        for t in rivals
    )
    about = tuple(dict.fromkeys(each for t in rivals for each in t.hypothesis.about))
    what = f"Held-out samples are predicted as well ({baseline.fit.error_in_words()} as declared) if {listed}."
    return Finding(
        "ambiguous-convention",
        severity,
        about,
        what,
        ("Check which is true.", *_distinctions(cell, [t.hypothesis for t in rivals])),
    )


def _distinctions(cell: Cell, hypotheses: Sequence[ConventionHypothesis]) -> Iterator[str]:
    """Sentences that advise what to record, each once, with the robots of all hypotheses that it distinguishes."""
    robots: dict[str, list[tuple[str, ...]]] = {}
    for each in hypotheses:
        robots.setdefault(each.distinction, []).append(tuple(name for name in each.about if name in cell.robots))
    for distinction, names in robots.items():
        arms = " and ".join(dict.fromkeys(chain.from_iterable(names))) if all(names) else "every arm"
        if distinction:
            yield sentence(distinction.format(arms=arms))


def _distance_clause(baseline: TriedHypothesis, trial: TriedHypothesis, name: str) -> str:
    """Clause with the distance between the values of a transform; empty if the trial does not contain it."""
    if name not in trial.fit.solution.state.transforms:
        return ""
    shift_m = np.linalg.norm(_difference(baseline.fit, trial.fit, name).translation)
    return f", {name} {two_digits(1e3 * float(shift_m))} mm away"


def noise_evidence(fit: HypothesisFit, baseline: HypothesisFit) -> Comparison | None:
    """Evidence of the data for a hypothesis that has the declared one as a special case.

    With robots assumed exact, any further unknown compensates some of their errors and improves predictions, most of
    all with few samples. With noise estimated under both hypotheses, the gain shows whether the hypothesis itself
    explains the data.

    For a size, two likelihoods are compared: that of the view poses, and that of the scatter of 3-D points about them.
    3-D points determine the size, while the scatter of pixels is the same for a target of any size. The search for the
    noise of the hypothesis starts from that of the declared one. If both robots and images may have errors, two
    noise estimates explain the views. A gain of one over the other is then no gain of the hypothesis.

    For a lens or a transform that is freed, the evidence is its squared distance from the stated one, in sigmas.
    Likelihoods are not compared in this case. Views that estimate their own lens contain more information than those
    that do not, and restricted likelihoods of different unknowns are not comparable.

    Args:
        fit: Fit of the hypothesis.
        baseline: Fit of the declared hypothesis.

    Returns:
        None if the two fits use different views.
    """
    if _view_count(fit.solution) != _view_count(baseline.solution):
        return None
    noisy = Settings(robot_noise="estimated")
    narrower = solve_at_mode(baseline.solution.problem, baseline.solution.state, noisy)
    wider = solve_at_mode(fit.solution.problem, fit.solution.state, noisy, guess=narrower.noise)
    freed = [name for name in wider.problem.columns if name not in narrower.problem.columns]
    if not freed:
        gain = narrower.noise.minus_2_log_evidence - wider.noise.minus_2_log_evidence + _scatter_gain(wider, narrower)
        return compare_nested_models(gain, 1, CONFIRMED_LEVEL)
    step = state_step(wider.problem, narrower.state, wider.state)
    off = [_squared_distance(wider, step, name) for name in freed]
    gain = sum(square for square, _ in off)
    return compare_nested_models(gain, sum(count for _, count in off), CONFIRMED_LEVEL)


def _view_count(solution: Solution) -> int:
    return sum(map(len, solution.problem.groups))


def _scatter_gain(wider: Solution, narrower: Solution) -> float:
    """Twice the log likelihood ratio of 3-D points about the view poses; from their scatter if sigma is unstated."""
    gain, more = 0.0, _scatter(narrower)
    for name, (less, freedoms) in _scatter(wider).items():
        if name == STATED:
            gain += more[name][0] - less
        elif less > 0 and more[name][0] > 0:
            gain += freedoms * float(np.log(more[name][0] / less))
    return gain


def _scatter(solution: Solution) -> dict[str, tuple[float, float]]:
    """Squared residuals of 3-D points about the view pose at unit sigma and degrees of freedom, by `Noise` field."""
    found: dict[str, tuple[float, float]] = {}
    for group in (g for g in solution.problem.groups if isinstance(g.measurement, PointMeasurement)):
        for name, view in view_estimates(solution.problem, group, solution.state).items():
            squares, freedoms = found.get(name, (0.0, 0.0))
            found[name] = squares + view.white, freedoms + view.white_count
    return found


def _squared_distance(solution: Solution, step: Array, name: str) -> tuple[float, int]:
    """Squared Mahalanobis distance of a lens or transform from its stated value, and its degrees of freedom."""
    where = solution.problem.columns[name]
    known = spectrum(solution.covariance[where, where])
    return float(known.squared_mahalanobis(step[where])), int(known.rank)
