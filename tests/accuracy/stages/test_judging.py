"""Tests of the stages that judge a solution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.clocks.step import ClockStep
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.accuracy.stages import judging
from basecal.accuracy.stages import judging as module
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.judging import prove_solution, thin_solution
from basecal.accuracy.systematic_errors.expected_sizes import ContainedSizes
from basecal.cell import Finding, Recording, Sample
from basecal.effects.faces.effect import FoundEffect
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

MADE = simulate(Scenario(samples=3), seed=0)


@pytest.mark.parametrize(("small", "refuted"), [((), False), ((False,), False), ((False, True), True)])
def test_refuted_solution_is_passed_to_systematic_errors(monkeypatch, small, refuted):
    """If a stated sigma is too small, the solution with the stated sigmas is passed to the systematic-error search."""
    given = []
    robust = SimpleNamespace(solution="without them")
    contradicted = tuple(SimpleNamespace(is_too_small=each) for each in small)
    monkeypatch.setattr(judging, "contradicted_sigmas", lambda solution: contradicted)
    monkeypatch.setattr(judging, "unlikely_sigmas", lambda *words: ())
    monkeypatch.setattr(judging, "without_contradicted_sigmas", lambda *words: robust)
    monkeypatch.setattr(judging, "systematic_error", lambda *words: given.append(words) or "found")
    recording = Recording((*MADE.recording.samples, Sample(3, images={"wrist": "images/4.png"})))
    before = Case(MADE.cell, recording, Settings(), packed="all", robust=SimpleNamespace(solution="as stated"))
    found = judging.find_systematic_error(judging.screen_stated_sigmas(before))
    assert found.evidence.systematic_error == "found"
    assert found.evidence.contradicted_sigmas == contradicted
    stamps = {k: s.stamp_s for k, s in enumerate(MADE.recording.samples) if s.stamp_s is not None}
    assert found.evidence.images == {(3, "wrist"): "images/4.png"}
    assert given == [("without them", "all", stamps, Settings(), "as stated" if refuted else None)]


def test_fixed_transform_error_is_listed_once(monkeypatch):
    """The error of a fixed transform is listed once, as first found; other findings stay, repeated and in order."""
    code = judging.fixed_transform.CODE
    mount, again, base = (Finding(code, "warning", (about,), what) for about, what in ("a1", "a2", "b1"))
    other = Finding("poor-fit", "warning", ("a",), "other")
    monkeypatch.setattr(judging, "ANSWER_CHECKS", (lambda evidence: [again, other], lambda evidence: [base, other]))
    monkeypatch.setattr(judging, "deduplicate_size_findings", lambda cell, findings, error: [*findings, error])
    before = Case(MADE.cell, MADE.recording, Settings(), findings=(other, mount))
    before = replace(before, gathered_evidence=SimpleNamespace(systematic_error=again))
    assert judging.list_findings(before).findings == (other, mount, other, base, other)


def test_uncertain_effect_widens_by_its_probability():
    """An uncertain effect widens the covariance by its probability times the variance of its move."""
    solution = solve(MADE.cell, MADE.recording)
    moved = np.sqrt(np.diag(solution.covariance))
    named = "length_scale", "length-scale", "hand", False, False, None, "m", np.ones(1), np.eye(1), moved
    for share in (0.5, 1.0):
        shift = judging._effect_shift(solution, FoundEffect(*named, probability=share), frozenset())
        np.testing.assert_allclose(np.outer(shift, shift), share * np.outer(moved, moved))


def test_uncertain_effect_in_field_is_not_counted(monkeypatch):
    """An uncertain effect by place of a robot with a field is not counted beside it; all others are."""
    solution = solve(MADE.cell, MADE.recording)
    moved = np.sqrt(np.diag(solution.covariance))
    monkeypatch.setattr(judging, "situate", lambda solution: None)
    monkeypatch.setattr(judging, "stated_fields", lambda cell, of: [SimpleNamespace(robot="hand")])

    def shift(name, about, is_certain):
        """How far an effect moves the answer."""
        effect = FoundEffect(name, "", about, False, False, None, "", np.ones(1), np.eye(1), moved, None, is_certain)
        evidence = replace(evidence_of(MADE.cell, solution), systematic_error=effect)
        in_fields = judging._robots_with_fields(Case(MADE.cell, MADE.recording, Settings(), gathered_evidence=evidence))
        return judging._effect_shift(solution, effect, in_fields)

    assert not shift("stretch", "hand", False).any()
    for name, about, is_certain in (("stretch", "hand", True), ("stretch", "eye", False), ("step", "hand", False)):
        np.testing.assert_array_equal(shift(name, about, is_certain), moved)


def make_containing(moved, shift_s=(), variance=()):
    """Expected sizes that widen an answer by a move, and clock offsets by variances."""

    def contain(cell, solution, error, offsets):
        """The wider answer; offsets are given if clocks are."""
        assert (offsets is None) == (len(shift_s) == 0)
        return ContainedSizes(judging.widen(solution, moved), np.array(shift_s), np.diag(variance))

    return contain


def test_clock_step_contains_effects(monkeypatch):
    """Clocks are stepped from the fit, and the answer is widened by the fitted offset.

    The part of effects that acts through the offset is in the effects' own variance.
    """
    solution = solve(MADE.cell, MADE.recording)
    sigma = np.sqrt(np.diag(solution.covariance))
    left = ClockStep(("wrist",), np.zeros(1), np.eye(1), sigma[:, None], np.ones(1, dtype=bool), "offsets")
    monkeypatch.setattr(judging, "remaining_step", lambda clocked, fitted: left if fitted is solution else None)
    monkeypatch.setattr(judging, "contain_expected_sizes", make_containing(3 * sigma, (0.2,), (8.0,)))
    evidence = evidence_of(MADE.cell, solution)
    covered = judging.cover_effects(
        Case(MADE.cell, MADE.recording, Settings(), gathered_evidence=evidence, clocked="clocked")
    )
    by_effects, by_clocks = (b.covariance - a.covariance for a, b in pairwise(covered.answers))
    np.testing.assert_allclose(by_effects, 9 * np.outer(sigma, sigma), rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(by_clocks, np.outer(sigma, sigma), rtol=1e-9, atol=1e-18)
    assert (covered.clock_step.step_s.item(), covered.clock_step.covariance.item()) == (0.2, 9.0)


def test_covariance_covers_each_effect(monkeypatch):
    """The covariance covers each effect.

    Of confounded ones it covers that which moves the answer most, in its sigmas.
    """
    solution = solve(MADE.cell, MADE.recording)
    width = solution.problem.width
    sigma = np.sqrt(np.diag(solution.covariance))
    small, large = (k * sigma * (np.arange(width) == k) for k in (1, 2))
    effect = SimpleNamespace(moved=small)
    monkeypatch.setattr(judging, "contain_expected_sizes", make_containing(large))
    case = Case(MADE.cell, MADE.recording, Settings(), gathered_evidence=evidence_of(MADE.cell, solution))
    fitted, covered, final = judging.cover_effects(case.with_evidence(lens_structures=(effect,))).answers
    assert fitted is solution
    assert final is covered
    added = covered.covariance - solution.covariance
    np.testing.assert_allclose(added, np.outer(small, small) + np.outer(large, large), atol=1e-18)


@dataclass(frozen=True)
class Answer:
    """A solution at some state."""

    state: int
    disputed: bool = False
    problem: str = "problem"
    findings: tuple[str, ...] = ("finding",)


@dataclass(frozen=True)
class Found:
    """A certificate, and a better state or none."""

    certificate: str
    better: int | None


@pytest.fixture
def better_by_one(monkeypatch):
    """Gives every state up to the fourth a better one; records what is solved."""
    solved = []

    def solve_from(problem, state, settings, findings):
        solved.append((problem, state, settings, findings))
        return Answer(state)

    monkeypatch.setattr(module, "certify", lambda of: Found(f"of {of.state}", of.state + 1 if of.state < 4 else None))
    monkeypatch.setattr(module, "solve_from", solve_from)
    return solved


def test_certificate_needs_request_or_dispute(better_by_one):
    """A certificate is computed only if it is requested or the solution is disputed; the solution is unchanged."""
    assert prove_solution(Answer(9), Settings()) == (Answer(9), None)
    assert prove_solution(Answer(9), Settings(certify=True)) == (Answer(9), "of 9")
    assert prove_solution(Answer(9, disputed=True), Settings()) == (Answer(9, disputed=True), "of 9")
    assert better_by_one == []


@pytest.mark.parametrize(("start", "end"), [(2, 4), (1, 4), (0, 3)])
def test_better_optima_are_followed_three_times(better_by_one, start, end):
    """At most three better optima are followed in turn, each solved with the same settings; the dispute stays known."""
    settings = Settings(certify=True)
    best, certificate = prove_solution(Answer(start, disputed=True), settings)
    assert best == Answer(end, disputed=True)
    assert certificate == f"of {end}"
    assert better_by_one == [("problem", k, settings, ("finding",)) for k in range(start + 1, end + 1)]


def test_well_posed_cell_is_certified():
    """Poses seen by two arms are certified as global, with the solution unchanged."""
    made = simulate(Scenario(target="pose", samples=12), 1)
    solution = solve(made.cell, made.recording)
    best, certificate = prove_solution(replace(solution, disputed=True), Settings())
    assert certificate is not None
    assert certificate.is_global is True
    assert best.state is solution.state


STATED = Settings(robot_noise="stated")


@pytest.mark.journey
@pytest.mark.parametrize("pixel_noise", [True, False])
def test_thinned_solution_has_equal_held_out_error(pixel_noise: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the views has three times the covariance and the same held-out error within a tenth."""
    made = simulate(replace(Scenario(samples=120, robot_noise=(1e-4, 2e-4)), state_pixel_noise=pixel_noise), 3)
    whole = solve(made.cell, made.recording, STATED)
    assert thin_solution(whole, STATED) is whole
    monkeypatch.setattr(judging, "MANY_VIEWS", 40)
    few = thin_solution(whole, STATED)
    assert [len(group) for group in few.problem.groups] == [40]
    name = "eye_base_from_hand_base"
    sizes = [np.sqrt(np.diag(each.joint_transform_covariance([name]))) for each in (whole, few)]
    assert 1.5 < np.median(sizes[1] / sizes[0]) < 2.0
    off = (whole.state.transforms[name].inverse() @ few.state.transforms[name]).log()
    assert np.all(np.abs(off) < 4 * sizes[1])
    errors = [_held_out_px(each, name) for each in (whole, few)]
    assert errors[1] == pytest.approx(errors[0], rel=0.1)


def _held_out_px(solution: Solution, name: str) -> float:
    found = cross_validate(solution, [name], STATED)
    assert found is not None
    assert found.summary is not None
    assert found.summary.rms_px is not None
    return found.summary.rms_px


def test_unconverged_thinned_solution_is_replaced_by_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """If the solution of some views does not converge, all views are used."""
    made = simulate(Scenario(samples=30), 0)
    whole = solve(made.cell, made.recording, STATED)
    monkeypatch.setattr(judging, "MANY_VIEWS", 10)
    monkeypatch.setattr(judging, "solve_at_mode", lambda *of: replace(whole, converged=False))
    assert thin_solution(whole, STATED) is whole
