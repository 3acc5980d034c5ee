"""Which of the hypotheses of an input that were fitted are named: those that predict better, or as well elsewhere.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit, is_near, plausible
from basecal.accuracy.input_check.noise_evidence import noise_evidence
from basecal.accuracy.model_comparison.comparison import Comparison, Decision
from basecal.accuracy.model_comparison.held_out import CLEARLY, compare_predictions
from basecal.cell import Cell, Finding
from basecal.cell.calibration import Severity
from basecal.effects import fixed_transform
from basecal.effects.faces.effect import FIX
from basecal.errors import sentence
from basecal.estimation.noise.estimate import ROUNDING
from basecal.geometry import SE3

_CERTAIN = 100.0  # twice the log ratio of likelihoods: true sizes gain up to 40 where arms have errors of their own
_TAIL = 2.0  # rms of all samples over that of most, which no choice of samples makes
_SIGMAS = 3.0  # by which an answer has to move to count as another
# A wider model takes up some of the errors of arms and lenses: below this ratio of likelihoods it found no mix-up.
_WIDER = 2.0


@dataclass(frozen=True, eq=False)
class TriedHypothesis:
    """A hypothesis and how it predicts.

    Attributes:
        hypothesis: The hypothesis.
        fit: Its fit.
        impossible: The facts that it contradicts.
    """

    hypothesis: ConventionHypothesis
    fit: HypothesisFit
    impossible: tuple[str, ...]

    def compare(self, baseline: HypothesisFit) -> Comparison:
        """How it predicts the samples that the declared hypothesis has, too."""
        clearly = _WIDER if self.hypothesis.nested else CLEARLY
        return compare_readings(self.hypothesis.code, self.fit, baseline, clearly)


def compare_readings(rival: str, fit: HypothesisFit, reference: HypothesisFit, clearly: float = CLEARLY) -> Comparison:
    """A fit beside another one, by the samples that both predict."""
    shared = np.intersect1d(fit.sample, reference.sample)
    return compare_predictions(rival, fit.squares(shared), reference.squares(shared), clearly)


def has_tail(fit: HypothesisFit) -> bool:
    """Whether some samples are predicted far worse than most."""
    return bool(np.isfinite(fit.core) and fit.rms > _TAIL * fit.core)


def is_observable(cell: Cell, fit: HypothesisFit) -> bool:
    """Whether a fit determines all requested transforms."""
    return not any(name in fit.solution.observability.unobservable for name in cell.requested_transforms)


def decide_hypotheses(
    cell: Cell,
    baseline: TriedHypothesis,
    trials: Sequence[TriedHypothesis],
    is_explained: bool = False,
    still: frozenset[str] = frozenset(),
) -> tuple[Finding, ...]:
    """Findings about the hypotheses that are to be believed rather than the declared one, or as much.

    Args:
        cell: As declared.
        baseline: The declared hypothesis.
        trials: Others.
        is_explained: Whether noise such as arms have explains the residuals of robots that were assumed exact.
        still: Robots that stand still throughout.
    """
    possible = [t for t in trials if not t.impossible and is_observable(cell, t.fit) and plausible(t.fit)]
    winning = _confirm_against_noise([t for t in possible if _wins(cell, t, baseline)], baseline, is_explained)
    if winning:
        best = min(winning, key=lambda w: w[0].fit.core * w[0].fit.rms)[0]
        as_good = [(t, certain) for t, certain in winning if _is_as_good(t, best.fit)]
        # What was stated by hand is doubted before devices are.
        stated = [each for each in as_good if each[0].hypothesis.code == fixed_transform.CODE]
        return tuple(dict.fromkeys(_make_finding(cell, t, baseline, certain) for t, certain in stated or as_good))
    if not plausible(baseline.fit):
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
        if not t.hypothesis.nested and _is_as_good(t, baseline.fit) and _has_moved(cell, t, baseline.fit, baseline.fit)
    ]
    # Whatever is done to the one pose of an arm that stands still, its base makes up for it: no data tell otherwise.
    of_still = [t for t in rivals if set(t.hypothesis.about) <= still]
    others = [t for t in rivals if t not in of_still]
    kinds: tuple[tuple[Severity, list[TriedHypothesis]], ...] = (("warning", others), ("info", of_still))
    return tuple(_ambiguous(cell, baseline, of, severity) for severity, of in kinds if of)


def _is_as_good(trial: TriedHypothesis, reference: HypothesisFit) -> bool:
    return trial.compare(reference).decision is not Decision.KEEP


def _wins(cell: Cell, trial: TriedHypothesis, baseline: TriedHypothesis) -> bool:
    """Whether a hypothesis is to be believed rather than the declared one."""
    compared = trial.compare(baseline.fit)
    if baseline.impossible and compared.decision is not Decision.KEEP and not trial.hypothesis.nested:
        return True
    is_other = (
        trial.hypothesis.nested or not plausible(baseline.fit) or _has_moved(cell, trial, baseline.fit, trial.fit)
    )
    return compared.is_taken and is_other


def _has_moved(cell: Cell, trial: TriedHypothesis, baseline: HypothesisFit, scale: HypothesisFit) -> bool:
    """Whether a hypothesis moves the requested transforms by more than three sigmas of `scale`."""
    ignored = cell.mount_name(trial.hypothesis.about[0]) if trial.hypothesis.code == "board-symmetry" else None
    for name in cell.requested_transforms:
        if name == ignored and cell.transforms[name].status == "free":
            continue
        off = np.abs(_step(baseline, trial.fit, name).log())
        sigma = np.sqrt(np.maximum(np.diag(scale.solution.joint_transform_covariance([name])), 0.0))
        if np.any(off > _SIGMAS * np.maximum(sigma, ROUNDING)):
            return True
    return False


def _step(fit: HypothesisFit, rival: HypothesisFit, name: str) -> SE3:
    return fit.solution.state.transforms[name].inverse() @ rival.solution.state.transforms[name]


def _confirm_against_noise(
    winning: Sequence[TriedHypothesis], baseline: TriedHypothesis, is_explained: bool
) -> list[tuple[TriedHypothesis, bool]]:
    """Hypotheses that the data still support beside noise of the arms, and whether they leave no doubt."""
    found = []
    for tried in winning:
        if not tried.hypothesis.nested or not (is_explained or plausible(baseline.fit)):
            found.append((tried, True))
            continue
        evidence = noise_evidence(tried.fit, baseline.fit)
        if evidence is None or evidence.is_taken:
            found.append((tried, evidence is not None and evidence.gain > _CERTAIN))
    return found


def _make_finding(cell: Cell, trial: TriedHypothesis, baseline: TriedHypothesis, certain: bool) -> Finding:
    hypothesis = trial.hypothesis
    severity: Severity = "error" if certain else "warning"
    if trial.compare(baseline.fit).is_taken:
        errors = f"{trial.fit.error_in_words()} instead of {baseline.fit.error_in_words()}"
        why = f"Under this hypothesis the cross-validation error is {errors}."
    else:
        why = f"As declared it fits as well, but {' and '.join(baseline.impossible)} is implausible."
    what = sentence(hypothesis.words, hypothesis.about)
    do: tuple[str, ...] = (sentence(hypothesis.fix), FIX)
    if hypothesis.code == fixed_transform.CODE:
        (name,) = hypothesis.about
        stated, found = cell.transforms[name].mean, trial.fit.solution.transforms[name]
        assert stated is not None
        what, do = fixed_transform.disagreement(name, (stated.inverse() @ found.mean).log(), found.covariance)
    return Finding(hypothesis.code, severity, hypothesis.about, what, do, why)


def _ambiguous(cell: Cell, baseline: TriedHypothesis, rivals: Sequence[TriedHypothesis], severity: Severity) -> Finding:
    """One finding for all hypotheses that fit as well as the declared one."""
    name = cell.requested_transforms[0]
    moves = [1e3 * float(np.linalg.norm(_step(baseline.fit, t.fit, name).translation)) for t in rivals]
    listed = " or ".join(
        f"{t.hypothesis.words} ({t.hypothesis.code}: {t.fit.error_in_words()}, {name} {mm:.3g} mm away)"
        for t, mm in zip(rivals, moves, strict=True)
    )
    about = tuple(dict.fromkeys(each for t in rivals for each in t.hypothesis.about))
    distinctions = dict.fromkeys(t.hypothesis.distinction for t in rivals)
    what = f"Held-out samples are predicted as well ({baseline.fit.error_in_words()} as declared) if {listed}."
    return Finding(
        "ambiguous-convention",
        severity,
        about,
        what,
        ("Check which is true.", *(sentence(each) for each in distinctions if each)),
    )
