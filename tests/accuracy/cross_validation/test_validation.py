"""Tests of `cross_validate`: the answer moves as its covariance says, and wrong models give findings."""

from __future__ import annotations

from dataclasses import astuple, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import f as fisher
from tests.evidence import evidence_of
from tests.motion_cells import SCARA, recorded
from tests.pose_problem import MOUNT, pose_problem

from basecal.accuracy.cross_validation import validation
from basecal.accuracy.cross_validation.validation import (
    CrossValidation,
    FoldSpread,
    HeldOutErrors,
    _errors,
    _Fold,
    _fold,
    _group_errors,
    _group_key,
    _SingleViewPoses,
    _spread,
    _whitening,
    cross_validate,
    root_mean_square,
)
from basecal.accuracy.findings.inconsistent_folds import inconsistent_folds
from basecal.accuracy.findings.not_validated import not_validated
from basecal.accuracy.findings.overfit import overfit
from basecal.cell import Cell, Finding, Recording, Validation
from basecal.estimation.least_squares import sparse_normal_equations
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

LIGHT = Scenario(samples=25, target="led")
NOISY = Scenario(samples=15, robot_noise=(3e-4, 5e-4))


def validate_scenario(
    scenario: Scenario, seed: int, **changed
) -> tuple[Validation | None, set[str], tuple[Finding, ...]]:
    made = simulate(scenario, seed)
    cell: Cell = replace(made.cell, **changed)
    if changed.get("pixel_px", 0) is None:
        cell = replace(cell, robots={n: replace(r, noise=None) for n, r in cell.robots.items()})
    found, findings = check_recording(cell, made.recording)
    return found, {f.code for f in findings}, findings


def check_recording(cell: Cell, recording: Recording) -> tuple[Validation | None, tuple[Finding, ...]]:
    problem, _ = build_problem(cell, recording)
    solution = solve_problem(problem, cell)
    found = cross_validate(solution, cell.requested_transforms)
    evidence = evidence_of(cell, solution, found)
    return found and found.summary, (*not_validated(evidence), *inconsistent_folds(evidence), *overfit(evidence))


# The mean square change of a fold has mean 1. With equal folds it has 24 freedoms, less those that the folds
# share: at least 12. Over 8 cells the mean's sigma is at most sqrt(2 / 96) = 0.15; the band is 4 sigmas.
@pytest.mark.journey
@pytest.mark.parametrize(
    "scenario",
    [replace(NOISY, arms="stations", camera_mount="fixed", samples=25), LIGHT, NOISY],
    ids=["stations", "light", "robot noise"],
)
def test_change_of_answer_agrees_with_covariance(scenario):
    """With true sigmas the mean square change of folds over its covariance is 1 within 0.6, without findings."""
    found = [validate_scenario(scenario, seed) for seed in range(6)]
    changes = [each.base_change for each, _, _ in found if each is not None and each.base_change is not None]
    assert len(changes) == 6
    assert np.mean(changes) == pytest.approx(1.0, abs=0.6)
    assert [codes for _, codes, _ in found if codes] == []


@pytest.mark.journey
def test_sparse_validation_equals_dense_validation(monkeypatch):
    """Held-out errors and spread of three robots by sparse matrices equal dense ones, to a millionth."""
    scenario = Scenario(layout="ring", robots=3, samples=30, robot_noise=(1e-4, 1e-4))
    made = simulate(scenario, 1)
    problem, _ = build_problem(made.cell, made.recording)

    def checked_ring() -> CrossValidation:
        """Cross-validation of the solved ring."""
        found = cross_validate(
            solve_problem(problem, made.cell, Settings(robot_noise="stated")), made.cell.requested_transforms
        )
        assert found is not None
        return found

    dense = checked_ring()
    monkeypatch.setattr(sparse_normal_equations, "MANY_COLUMNS", 30)
    sparse = checked_ring()
    assert sparse.spread is not None
    assert dense.spread is not None
    both = [(of.spread.mean_square, of.spread.freedoms, of.spread.beyond_covariance.chance) for of in (sparse, dense)]
    np.testing.assert_allclose(*both, rtol=1e-5)
    errors = [astuple(replace(of.predicted, uncertain=0.0)) for of in (sparse, dense)]
    np.testing.assert_allclose(*errors, rtol=1e-5)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_unmodelled_robot_noise_is_found(arms):
    """Corners of a view share the robot error; treated as independent pixel noise, the answer moves too much."""
    scenario = replace(NOISY, arms=arms, camera_mount="fixed", samples=25)
    for seed in range(2):
        found, codes, _ = validate_scenario(scenario, seed, pixel_px=None)
        assert found is not None
        assert found.base_change is not None
        assert found.base_change > 5
        assert "inconsistent-folds" in codes


def test_held_out_errors_match_pixel_noise():
    """Held-out pixels of many board views are off by the pixel noise within 5 %, and the target by less than 1 mm."""
    found, _, _ = validate_scenario(Scenario(samples=60), 0)
    assert found is not None
    assert found.rms_px == pytest.approx(0.2, rel=0.05)
    assert found.target_m is not None
    assert found.target_m < 1e-3
    assert (found.kind, found.folds) == ("k-fold", 5)


def test_new_stop_is_predicted_at_recorded_pose():
    """With robots off by 1 mm, held-out pixels are off by about that, though used ones fit to the pixel noise."""
    scenario = Scenario(samples=30, robot_noise=(1e-3, 0.0))
    found, _, _ = validate_scenario(scenario, 0)
    assert found is not None
    assert found.rms_px is not None
    assert found.rms_px > 3 * 0.2


def test_led_has_no_held_out_pose():
    """A single LED is predicted in pixels only."""
    found, _, _ = validate_scenario(LIGHT, 0)
    assert found is not None
    assert found.target_m is None
    assert found.target_rad is None
    assert found.rms_px is not None


def test_change_of_led_offset_agrees_with_covariance():
    """A requested LED offset has three numbers that change by the size of their covariance."""
    made = simulate(LIGHT, 0)
    problem, _ = build_problem(made.cell, made.recording)
    found = cross_validate(solve_problem(problem, made.cell), [made.cell.mount_name("board")])
    assert found is not None
    assert 0.05 < found.summary.base_change < 4.0


def test_indispensable_sample_is_reported():
    """The only sample with a rotation of the hand about a second axis is not held out, and the finding names it."""
    made, other = recorded(Scenario(samples=14), 0, hand=SCARA), recorded(Scenario(samples=1), 0)
    last = replace(other.recording.samples[0], sample=14, stamp_s=14.0)
    found, findings = check_recording(made.cell, Recording((*made.recording.samples, last)))
    assert found is not None
    assert found.folds == 4
    (finding,) = findings
    assert finding.code == "not-validated"
    assert "14" in finding.about


def test_indispensable_stations_are_split():
    """Parts of stations are held out if none of three eye stations can be."""
    found, codes, _ = validate_scenario(Scenario(samples=18, arms="stations", stations=3), 0)
    assert found is not None
    assert found.folds == 5
    assert codes == set()


@pytest.mark.journey
def test_few_views_of_free_lens_predict_badly():
    """A free lens with distortion from five board views predicts badly, as its covariance expects."""
    for seed in range(2):
        made = simulate(Scenario(samples=5, intrinsics="free"), seed)
        problem, _ = build_problem(made.cell, made.recording)
        found = cross_validate(solve_problem(problem, made.cell), made.cell.requested_transforms)
        assert found.predicted.cost > 4 * found.fitted.cost
        assert 0.05 < found.predicted.cost / (found.fitted.cost + found.predicted.uncertain) < 9


def test_held_out_cost_matches_expectation():
    """The held-out cost with robot noise matches its expectation within a third, over 3 cells of 8 samples."""
    cost, expected = 0.0, 0.0
    for seed in range(3):
        made = simulate(replace(NOISY, samples=8), seed)
        problem, _ = build_problem(made.cell, made.recording)
        found = cross_validate(solve_problem(problem, made.cell), made.cell.requested_transforms)
        cost, expected = cost + found.predicted.cost, expected + found.fitted.cost + found.predicted.uncertain
    assert cost == pytest.approx(expected, rel=0.33)


def test_unobservable_answer_is_not_validated():
    """An answer whose requested transform is unobservable is not validated."""
    found, codes, _ = validate_scenario(Scenario(arms="eye_still"), 0)
    assert found is None
    assert codes == set()


def test_views_of_two_kinds_are_predicted():
    """If some samples have poses instead of pixels, each view is compared with its own pose."""
    in_pixels, as_poses = (simulate(replace(NOISY, target=target), 0) for target in ("charuco", "pose"))
    pairs = zip(in_pixels.recording.samples, as_poses.recording.samples, strict=True)
    mixed = Recording(tuple(pair[sample % 3 == 0] for sample, pair in enumerate(pairs)))
    found, alarms = check_recording(in_pixels.cell, mixed)
    assert not alarms
    assert found.rms_px < 1.5
    assert found.target_m < 4e-3


def test_fixed_cell_is_predicted():
    """In a cell with all transforms fixed pixels are predicted by the noise, and no answer can move."""
    scenario = Scenario(base="fixed", camera_mount="fixed", target_mount="fixed")
    found, codes, _ = validate_scenario(scenario, 0)
    assert found is not None
    assert found.rms_px == pytest.approx(0.2, rel=0.05)
    assert found.base_change is None
    assert codes == set()


def test_fold_errors_add_up():
    """Errors of folds add up sum by sum and count by count, from zero."""
    one, two = HeldOutErrors(1.0, 2.0, 3, 4.0, 5.0, 6), HeldOutErrors(10.0, 20.0, 30, 40.0, 50.0, 60)
    assert one + two == HeldOutErrors(11.0, 22.0, 33, 44.0, 55.0, 66)
    assert HeldOutErrors() + one == one


def test_root_mean_square_needs_count_and_finite_sum():
    """The root mean square is None without counts or with an infinite sum."""
    assert root_mean_square(12.0, 3) == 2.0
    assert root_mean_square(12.0, 1) == np.sqrt(12.0)
    assert root_mean_square(12.0, 0) is None
    assert root_mean_square(np.inf, 3) is None


@pytest.mark.slow
def test_clean_cells_have_no_false_alarm():
    """At most one of 400 clean cells gives a finding, each with a chance of 1e-4.

    Two or more occur once in 1,200 runs.
    """
    scenarios = [Scenario(samples=12), LIGHT, NOISY, Scenario(samples=15, state_pixel_noise=False)]
    rung = [validate_scenario(scenarios[k % 4], k)[1] for k in range(400)]
    assert sum("inconsistent-folds" in codes for codes in rung) <= 1


@pytest.mark.parametrize("full", [np.eye(4), np.diag([4.0, 1e-4, 9.0, 1.0]), np.eye(4) + 0.5])
def test_whitening_covers_partly_lost_directions(full):
    """Changes are compared along directions whose variance grew by more than 1 % and less than eleven times.

    There they have unit variance.
    """
    root = np.linalg.cholesky(full)
    gains = np.array([0.0099, 0.0101, 9.9, 10.1])
    without = full + root @ np.diag(gains) @ root.T
    found = _whitening(without, full)
    assert found.shape == (2, 4)
    np.testing.assert_allclose(found @ (without - full) @ found.T, np.eye(2), atol=1e-9)
    np.testing.assert_allclose(found @ root[:, [0, 3]], 0, atol=1e-9)  # the other directions are removed


COUNTS = [20, 20, 30, 10]  # held-out equations of each fold, all with equal information


def spread_of(monkeypatch, counts, changes, asked=2, **noise):
    """The spread of folds with answers of independent numbers that changed by these sigmas."""
    total, factor = sum(counts), noise.pop("factor", 1.0)
    usual = {"estimated": (), "factor": factor} | noise
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={}),
        state="full",
        noise=SimpleNamespace(**usual),
        covariance=factor * np.eye(3) / total,
        dof=total - 3,
    )
    fits = [
        SimpleNamespace(sparse=None, optimum=SimpleNamespace(state=k, hessian=(total - count) * np.eye(3)))
        for k, count in enumerate(counts)
    ]
    folds = [_Fold(fit, np.eye(3)[:, :asked] / (total - count)) for fit, count in zip(fits, counts, strict=True)]
    sigma = [np.sqrt(factor * (1 / (total - count) - 1 / total)) for count in counts]

    def moved(problem, full, fold):
        """The given number of sigmas."""
        return np.asarray(changes[fold])[:asked] * sigma[fold]

    monkeypatch.setattr(validation, "_information", lambda of: total * np.eye(3))
    monkeypatch.setattr(validation, "state_step", moved)
    return _spread(solution, folds, np.arange(asked))


CHANGES = [(1.0, -2.0), (0.5, 0.5), (3.0, 0.0), (-1.0, 1.0)]


@pytest.mark.parametrize("factor", [1.0, 2.5])
@pytest.mark.parametrize("estimated", [(), ("pixel_px",)])
def test_fold_spread_follows_chi_square(monkeypatch, factor, estimated):
    """The spread is the mean square over its expectation, with freedoms by the correlation of folds.

    With estimated noise it follows Fisher's distribution.
    """
    found = spread_of(monkeypatch, COUNTS, CHANGES, factor=factor, estimated=estimated)
    mean = np.mean(np.square(CHANGES))
    assert found.mean_square == pytest.approx(mean)
    total = sum(COUNTS)
    left = total - np.array(COUNTS)
    # Cov(j - full, k - full) by the equations used by both folds, over the product of their sigmas.
    both = np.where(np.eye(4), left, np.add.outer(left, left) - total)
    together = both / np.outer(left, left) - 1 / total
    sigma = np.sqrt(1 / left - 1 / total)
    freedoms = 8**2 / (2 * np.sum((together / np.outer(sigma, sigma)) ** 2))
    assert found.freedoms == pytest.approx(freedoms)
    if factor == 1.0 and not estimated:
        assert found.beyond_covariance.chance == pytest.approx(chi2.sf(freedoms * mean, freedoms))
    else:
        assert found.beyond_covariance.chance == pytest.approx(fisher.sf(mean, freedoms, total - 3))


def test_spread_needs_enough_freedoms(monkeypatch):
    """Five equal folds have four freedoms for one number and eight for two.

    Without requests or without losses there is no spread.
    """
    alike = [20] * 5
    assert spread_of(monkeypatch, alike, [(1.0, 1.0)] * 5, 1) is None
    assert spread_of(monkeypatch, alike, [(1.0, 1.0)] * 5, 2).freedoms == pytest.approx(8.0)
    assert spread_of(monkeypatch, alike, [(1.0, 1.0)] * 5, 0) is None
    assert spread_of(monkeypatch, [1000, 1, 1], [(1.0, 1.0)] * 3) is None


def test_pose_errors_are_those_of_predictions():
    """Costs and squares are those of predicted poses, used and held out; an LED's pixels have no pose."""
    rng = np.random.default_rng(1)
    errors = 1e-3 * rng.standard_normal((6, 6))
    problem, state = pose_problem(errors, np.full(6, 2e-3))
    (group,) = problem.groups
    some = group.take(np.array([1, 4]))
    off = errors[[1, 4]]
    for alone in (
        {},
        {_group_key(group): _SingleViewPoses(group.sample, group.measurement.measured_camera_from_target, ODD)},
    ):
        found = _group_errors(problem, some, state, alone)
        kept = off if not alone else off[:1]
        assert (found.count_px, found.square_px, found.count_poses) == (0, 0.0, len(kept))
        assert found.cost == pytest.approx(np.sum(off**2) / 4e-6, rel=1e-6)
        assert found.square_rad == pytest.approx(np.sum(kept[:, 3:] ** 2), rel=1e-6)
        assert found.square_m == pytest.approx(np.sum(kept[:, :3] ** 2), rel=1e-3)
    assert _group_errors(problem, some, state, None) == HeldOutErrors(found.cost)


ODD = np.arange(6) % 2 == 1


@pytest.mark.parametrize(("lost", "ways", "folds", "skipped"), [
    ([0, 0, 0, 0], 1, 4, ()), ([1, 0, 0, 0], 1, 3, (0,)), ([1, 1, 0, 0], 2, 2, (0, 1)), ([1, 1, 1, 0], 2, 1, (0, 1, 2)),
    ([1, 1, 1, 1], 2, None, (0, 1, 2, 3)),
])  # fmt: skip
def test_milder_splits_follow_if_half_of_folds_fail(monkeypatch, lost, ways, folds, skipped):
    """Milder splits are tried until more than half of the folds can be fitted.

    The skipped samples of the last are listed.
    """
    tried = []

    def refitted(problem, state, folds, iterations):
        """Folds of one sample each."""
        tried.append(iterations)
        return [SimpleNamespace(held=held) for held in folds]

    split = SimpleNamespace(folds=tuple(frozenset({k}) for k in range(4)))
    monkeypatch.setattr(validation, "splits", lambda problem: iter([split, split]))
    monkeypatch.setattr(validation, "refit_folds", refitted)
    monkeypatch.setattr(
        validation, "_fold", lambda of, free, chosen, fit: None if lost[min(fit.held)] else _Fold(fit, 0)
    )
    monkeypatch.setattr(validation, "_errors", lambda *of: (HeldOutErrors(), HeldOutErrors(1.0, 8.0, 2, 27.0, 12.0, 3)))
    monkeypatch.setattr(validation, "_spread", lambda *of: None)
    monkeypatch.setattr(validation, "closed_form_rival", lambda solution, fits: len(fits))
    bare = Problem("arm", (), {}, frozenset(), {}, Stops(np.zeros((0, 6))), {"a": slice(0, 6)})
    observability = SimpleNamespace(unobservable=frozenset({"other"}))
    solution = SimpleNamespace(converged=True, problem=bare, state=None, observability=observability)
    found = cross_validate(solution, ["a", "fixed"], Settings(iterations=7))
    assert tried == [7] * ways
    assert found.skipped == set(skipped)
    if folds is None:
        assert (found.summary, found.spread, found.rival) == (None, None, None)
        return
    assert (found.summary.kind, found.summary.folds, found.rival) == ("leave-one-out", folds, folds)
    assert (found.summary.rms_px, found.summary.target_m, found.summary.target_rad) == (2.0, 3.0, 2.0)
    for changed in ({"converged": False}, {"observability": SimpleNamespace(unobservable=frozenset({"a"}))}):
        assert cross_validate(SimpleNamespace(**vars(solution) | changed), ["a"]) is None


def test_pixel_errors_cover_seen_points():
    """Pixel errors cover the seen points whatever their weight; each has two numbers."""
    made = simulate(Scenario(samples=3), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    (group,) = problem.groups
    seen = np.random.default_rng(0).uniform(size=group.measurement.weight.shape) < 0.7
    group = replace(group, measurement=replace(group.measurement, weight=0.5 * seen))
    at = state.camera_from_target(group, problem.stops)
    points = at.rotation @ group.measurement.points_in_target.T + at.translation[..., None]
    off = state.cameras[group.camera].project(np.swapaxes(points, -1, -2)) - group.measurement.pixels
    found = _group_errors(problem, group, state, None)
    assert found.count_px == 2 * seen.sum()
    assert found.square_px == pytest.approx(np.sum(off[seen] ** 2), rel=1e-9)
    assert found.cost == pytest.approx(0.25 * found.square_px, rel=1e-9)


@pytest.mark.parametrize(("held", "kind"), [((1, 1), "leave-one-out"), ((1, 2), "k-fold")])
def test_single_sample_folds_are_leave_one_out(monkeypatch, held, kind):
    """Folds of one sample each are called leave-one-out."""
    folds = [SimpleNamespace(held=range(count)) for count in held]
    monkeypatch.setattr(validation, "splits", lambda problem: iter([SimpleNamespace(folds=folds)]))
    monkeypatch.setattr(validation, "refit_folds", lambda problem, state, folds, iterations: folds)
    monkeypatch.setattr(validation, "_fold", lambda of, free, chosen, fit: _Fold(fit, np.zeros(0)))
    monkeypatch.setattr(validation, "_errors", lambda *of: (HeldOutErrors(), HeldOutErrors()))
    monkeypatch.setattr(validation, "_spread", lambda *of: FoldSpread(1.5, 8.0, None))
    monkeypatch.setattr(validation, "closed_form_rival", lambda *of: None)
    solution = SimpleNamespace(
        converged=True,
        problem=SimpleNamespace(columns={}, column_indices=lambda names: None),
        state=None,
        observability=SimpleNamespace(unobservable=frozenset()),
    )
    found = cross_validate(solution, [])
    assert (found.summary.kind, found.summary.folds, found.summary.base_change) == (kind, 2, 1.5)
    assert (found.summary.rms_px, found.summary.target_m, found.spread.freedoms) == (None, None, 8.0)


def make_fold(problem, state):
    """A fold that holds out all views, with its own fit."""
    fit = SimpleNamespace(
        known=np.zeros(len(problem.stops), dtype=bool),
        views=problem,
        optimum=SimpleNamespace(state=state, hessian=np.eye(problem.width)),
        sparse=None,
    )
    return _Fold(fit, np.zeros((0, 0)))


def test_used_views_have_poses_only_if_observed():
    """Errors of the full answer are in pixels if there are some, held-out errors in pixels and poses."""
    errors = 1e-3 * np.random.default_rng(0).standard_normal((5, 6))
    problem, state = pose_problem(errors, np.full(6, 1e-3))
    moved = replace(state, transforms={**state.transforms, MOUNT: SE3.exp([2e-3, 0, 0, 0, 0, 0])})
    used, predicted = _errors(
        SimpleNamespace(problem=problem, state=state, noise=NoiseEstimate(Noise(), 1.0, (), True)),
        [make_fold(problem, moved)],
    )
    assert used.count_poses == predicted.count_poses == 5
    assert used.square_rad == pytest.approx(np.sum(errors[:, 3:] ** 2), rel=1e-6)
    assert predicted.square_m > used.square_m
    made = simulate(Scenario(samples=3), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    used, predicted = _errors(
        SimpleNamespace(problem=problem, state=state, noise=NoiseEstimate(Noise(), 1.0, (), True)),
        [make_fold(problem, state)] * 2,
    )
    assert (used.count_poses, predicted.count_poses) == (0, 6)
    assert used.square_px == pytest.approx(predicted.square_px)
    assert used.count_px == predicted.count_px > 0


@pytest.mark.parametrize(("converged", "sparse", "condition", "unobservable", "columns"), [
    (True, True, 9.0, (), "by sparse"), (True, True, None, (), "by dense"), (True, False, 9.0, (), "by dense"),
    (True, False, None, ("b",), "by dense"), (True, False, None, ("a",), None), (False, True, 9.0, (), None),
])  # fmt: skip
def test_fold_must_determine_requested_transforms(monkeypatch, converged, sparse, condition, unobservable, columns):
    """A fold that did not converge, or leaves a requested transform unobservable, is dropped.

    Sparse matrices are used if they are enough.
    """
    matrix = SimpleNamespace(inverse_columns=lambda chosen: "by sparse") if sparse else None
    fit = SimpleNamespace(
        optimum=SimpleNamespace(converged=converged, state=None, hessian=None), sparse=matrix, used="used"
    )
    inverse = type("Inverse", (), {"__getitem__": lambda self, where: "by dense"})()
    dense = SimpleNamespace(unobservable=frozenset(unobservable), inverse=inverse)
    monkeypatch.setattr(validation, "condition_number", lambda *of: condition)
    monkeypatch.setattr(validation, "analyse_observability", lambda used, *of: dense if used == "used" else None)
    found = _fold(SimpleNamespace(noise=SimpleNamespace(factor=1.0)), ["a"], np.zeros(1), fit)
    assert (None if found is None else found.columns) == columns
