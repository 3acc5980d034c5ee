"""Tests of local fits: recommended if arms bend, not for noise alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, kstest
from tests.pose_problem import MOUNT, pose_problem

from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.accuracy.task import local_fits as module
from basecal.accuracy.task.local_fits import (
    CHANCE_LIMIT,
    FEWEST_SAMPLES,
    MOST_PARTS,
    _chance_of_noise,
    _compare_fits,
    _halves,
    _samples_inside,
    _squares,
    local_fits,
)
from basecal.accuracy.task.meeting import target_places
from basecal.cell import Recording, RobotState
from basecal.estimation.solve import Solution, solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate

BASE = "eye_base_from_hand_base"
WIDE = Scenario(
    samples=48, target="points", position_m=0.4, robot_noise=(1e-4, 2e-4), camera_mount="fixed", target_mount="fixed"
)


def bend_hand(made: SimulatedCell, metres: float) -> Recording:
    """The recording of a hand whose flange is off by a wave of this size over the workspace."""
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"].base_from_flange
        assert hand is not None
        off = metres * np.array([*np.sin(hand.translation / 0.25), 0.0, 0.0, 0.0])
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(hand @ SE3.exp(off))}))
    return Recording(tuple(samples))


@pytest.fixture(scope="module")
def made() -> SimulatedCell:
    return simulate(WIDE, 5)


def test_unobservable_base_has_no_local_fits(made: SimulatedCell) -> None:
    """Without an observable base there are no local fits. Arms that only translate once made a task point fail."""
    assert local_fits(solve(made.cell, made.recording), []) == ()


def test_noise_alone_has_no_better_part(made: SimulatedCell) -> None:
    """With noise alone no part is clearly better; every sample is in one part, each with enough samples."""
    found = local_fits(solve(made.cell, made.recording), [BASE])
    assert len(found) == MOST_PARTS
    assert sorted(number for part in found for number in part.samples) == list(range(48))
    assert all(len(part.samples) >= FEWEST_SAMPLES for part in found)
    assert all(part.local_m > 0.9 * part.global_m for part in found)
    assert not any(part.is_better for part in found)


@pytest.mark.slow
def test_chances_of_noise_are_uniform() -> None:
    """Chances of forty parts without a wave are uniform by a Kolmogorov test at 0.1 %."""
    scenario = replace(WIDE, samples=40)
    chances = []
    for seed in range(10):
        noisy = simulate(scenario, 300 + seed)
        chances += [part.chance for part in local_fits(solve(noisy.cell, noisy.recording), [BASE])]
    assert kstest(chances[::2], "uniform").pvalue > 1e-3


def test_bent_arms_have_better_local_fits(made: SimulatedCell) -> None:
    """A wave of 3 mm over the workspace gives parts that predict clearly better and are recommended."""
    found = local_fits(solve(made.cell, bend_hand(made, 3e-3)), [BASE])
    better = [part for part in found if part.is_better]
    assert better
    assert all(part.local_m < part.global_m and part.chance < CHANCE_LIMIT for part in better)
    assert all(np.isfinite(part.transforms[BASE].matrix).all() for part in found)


def test_few_samples_have_no_parts(made: SimulatedCell) -> None:
    """Fewer samples than two parts need give no local fit."""
    few = Recording(made.recording.samples[: 2 * FEWEST_SAMPLES - 1])
    assert local_fits(solve(made.cell, few), [BASE]) == ()


@pytest.mark.journey
def test_box_is_single_part(made: SimulatedCell) -> None:
    """A box of two opposite corners in any order is the only part, with the samples whose targets are in it."""
    solution = solve(made.cell, bend_hand(made, 3e-3))
    halves = local_fits(solution, [BASE])
    places = np.array([target_places(group, solution.state) for group in solution.problem.groups])[0]
    low, high = places.min(0), places.max(0)
    high[0] = np.median(places[:, 0])
    (found,) = local_fits(solution, [BASE], [*high, *low])
    inside = solution.problem.groups[0].sample[np.all((places >= low) & (places <= high), axis=-1)]
    assert found.samples == tuple(sorted(inside))
    assert FEWEST_SAMPLES < len(found.samples) < 48
    assert found.is_better == (found.chance < CHANCE_LIMIT and found.local_m < found.global_m)
    assert len(halves) > 1


def test_box_with_few_samples_is_no_part(made: SimulatedCell) -> None:
    """A box without enough samples is no part."""
    solution = solve(made.cell, made.recording)
    assert local_fits(solution, [BASE], [5.0, 5.0, 5.0, 6.0, 6.0, 6.0]) == ()


def test_views_are_weighted_by_distance_to_part(made: SimulatedCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Views are weighted by a normal density about the part's middle.

    It is as wide as the spread of its own samples, equally in three directions.
    """
    given = []

    def refitted(*arguments, view_weights=None):
        """`refit_folds`, with recorded view weights."""
        given.append(view_weights)
        return refit_folds(*arguments, view_weights=view_weights)

    monkeypatch.setattr(module, "refit_folds", refitted)
    solution = solve(made.cell, made.recording)
    found = local_fits(solution, [BASE])
    (group,) = solution.problem.groups
    places = target_places(group, solution.state)
    everywhere, *parts = given
    assert everywhere is None
    assert len(parts) == len(found)
    for part, (worth,) in zip(found, parts, strict=True):
        own = places[np.isin(group.sample, part.samples)]
        np.testing.assert_allclose(part.centre_m, own.mean(0))
        reach = np.sqrt(np.mean(np.sum((own - own.mean(0)) ** 2, axis=-1)))
        away = np.linalg.norm(places - own.mean(0), axis=-1) / reach
        np.testing.assert_allclose(worth, np.exp(-(away**2) / 2))


def test_unconverged_fit_gives_no_recommendation(made: SimulatedCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """If any fit does not converge, the part has no errors, a chance of one, no recommendation, but its transforms."""
    few = Recording(bend_hand(made, 3e-3).samples[:24])
    solution = solve(made.cell, few)
    box = [-9.0, -9.0, -9.0, 9.0, 9.0, 9.0]
    (settled,) = local_fits(solution, [BASE], box)
    assert settled.samples == tuple(range(24))
    assert settled.global_m is not None
    assert settled.local_m is not None
    for worth_of in (False, True):

        def refitted(*arguments, view_weights=None, worth_of=worth_of):
            """`refit_folds`, with the last fit of one kind not converged."""
            *rest, last = refit_folds(*arguments, view_weights=view_weights)
            ended = np.array(bool(last.optimum.converged) and (view_weights is not None) != worth_of)
            return [*rest, replace(last, optimum=replace(last.optimum, converged=ended))]

        monkeypatch.setattr(module, "refit_folds", refitted)
        (found,) = local_fits(solution, [BASE], box)
        assert (found.global_m, found.local_m, found.chance, found.is_better) == (None, None, 1.0, False)
        np.testing.assert_allclose(found.transforms[BASE].matrix, settled.transforms[BASE].matrix)
    nothing = replace(solution, problem=solution.problem.with_groups(()))
    assert local_fits(nothing, [BASE]) == ()


def test_parts_are_halved_along_widest_direction() -> None:
    """Parts are halved along the widest direction until there are four, with equal counts.

    Here along x, then each along y.
    """
    x, y = np.meshgrid(np.arange(8.0), 0.5 * np.arange(8))
    places = np.stack([x.ravel(), y.ravel(), np.zeros(64)], -1)
    order = np.random.default_rng(0).permutation(64)
    found = [set(each.tolist()) for each in _halves(places[order], 3 * order)]
    wanted = [
        {3 * k for k in np.flatnonzero((places[:, 0] > 3.5) == right) if (places[k, 1] > 1.75) == far}
        for right in (False, True)
        for far in (False, True)
    ]
    assert sorted(map(min, found)) == sorted(map(min, wanted))
    assert all(each in wanted for each in found)


@pytest.mark.parametrize(("count", "parts"), [(19, 0), (20, 2), (38, 2), (39, 3), (40, 4)])
def test_part_needs_ten_samples(count: int, parts: int) -> None:
    """A part needs ten samples: a line of twenty has two parts, of forty four, of 39 only its larger half has two."""
    places = np.arange(count)[:, None] * [0.0, 0.0, 1.0]
    found = list(_halves(places, np.arange(count)))
    assert len(found) == parts
    assert not parts or sorted(np.concatenate(found).tolist()) == list(range(count))


def test_samples_count_once_despite_views() -> None:
    """Samples count once: twenty views of ten samples have no parts. The widest part is that with most views."""
    places = np.arange(20)[:, None] * [0.0, 1.0, 0.0]
    assert list(_halves(places, np.arange(20) // 2)) == []
    assert [each.tolist() for each in _halves(np.tile(places, (2, 1)), np.tile(np.arange(20), 2))] == [
        list(range(10)),
        list(range(10, 20)),
    ]


@pytest.mark.parametrize("corners", [[0, 0, 0, 1, 2, 3], [1, 2, 3, 0, 0, 0], [1, 0, 3, 0, 2, 0]])
def test_box_includes_its_sides(corners: list[float]) -> None:
    """A box of opposite corners in any order includes its sides; a place outside along one axis is outside."""
    inside = np.array([[0, 0, 0], [1, 2, 3], [0.5, 1, 1.5], [1, 0, 3]])
    outside = np.array([[1.1, 1, 1], [-0.1, 1, 1], [0.5, 2.1, 1], [0.5, 1, -0.1]])
    places = np.concatenate([np.repeat(inside, 3, axis=0), outside])
    (found,) = _samples_inside(places, np.arange(16), corners)
    assert found.tolist() == list(range(12))


@pytest.mark.parametrize(("count", "is_part"), [(9, False), (10, True)])
def test_box_needs_ten_samples(count: int, is_part: bool) -> None:
    """A box needs ten samples; each counts once."""
    samples = np.repeat(np.arange(count), 2)
    assert bool(list(_samples_inside(np.zeros((2 * count, 3)), samples, [-1, -1, -1, 1, 1, 1]))) == is_part


@pytest.mark.parametrize(("by_all", "by_part", "chance", "is_better"), [
    ((4.0, 4.0), (1.0, 1.0), 0.009, True), ((4.0, 4.0), (1.0, 1.0), 0.011, False), ((1.0, 1.0), (4.0, 4.0), 0.0, False),
    ((4.0, 1.0), (2.0, 2.0), 0.0, True), ((4.0,), (1.0,), 0.0, None), ((), (), 0.0, None),
])  # fmt: skip
def test_better_part_predicts_beyond_chance(
    monkeypatch: pytest.MonkeyPatch,
    by_all: tuple[float, ...],
    by_part: tuple[float, ...],
    chance: float,
    is_better: bool | None,
) -> None:
    """A part is better if its mean square is smaller beyond chance; a single held-out view is not enough.

    The transforms are those of the fit of all samples.
    """
    fit = {kind: SimpleNamespace(optimum=SimpleNamespace(converged=True), kind=kind) for kind in ("all", "part")}
    whole = SimpleNamespace(optimum=SimpleNamespace(converged=True, state=SimpleNamespace(transforms={"a": 1, "b": 2})))
    squares = {"all": by_all, "part": by_part}
    monkeypatch.setattr(module, "_squares", lambda solution, fit, inside: np.array(squares[fit.kind]))
    found = _compare_fits(None, [fit["all"]], [fit["part"], whole], [], np.zeros(3), np.array([4, 7]), ["b"], chance)
    assert (found.samples, found.transforms) == ((4, 7), {"b": 2})
    assert found.is_better == bool(is_better)
    if is_better is None:
        assert (found.global_m, found.local_m, found.chance) == (None, None, 1.0)
    else:
        assert (found.global_m, found.local_m) == pytest.approx((np.mean(by_all) ** 0.5, np.mean(by_part) ** 0.5))
        assert found.chance == chance


def make_solution(errors: np.ndarray, factor: float = 1.0) -> Solution:
    """An answer at the identity to poses near it with these errors."""
    problem, state = pose_problem(errors, np.full(6, 1e-3))
    return SimpleNamespace(problem=problem, state=state, noise=SimpleNamespace(factor=factor))


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_chance_of_weighted_mean_difference(factor: float) -> None:
    """The weighted mean differs from that of all n views with variance s^2 (sum w^2 / (sum w)^2 - 1 / n) per axis.

    Views have variance s^2 and weight w.
    """
    worth = np.linspace(0.1, 1.0, 9)
    step = 1e-4 * np.array([1.0, -2.0, 0.5, 3.0, 0.0, -1.0])
    solution = make_solution(np.zeros((9, 6)), factor)
    local = SimpleNamespace(optimum=SimpleNamespace(state=SimpleNamespace(transforms={MOUNT: SE3.exp(step)})))
    variance = factor * 1e-6 * (np.sum(worth**2) / np.sum(worth) ** 2 - 1 / 9)
    found = _chance_of_noise(solution, local, [worth], [MOUNT])
    assert found == pytest.approx(chi2.sf(step @ step / variance, 6), rel=1e-6)
    assert (
        _chance_of_noise(solution, local, [np.ones(9)], [MOUNT]) == 1.0
    )  # equal weights give the same fit, for any step


def test_squares_cover_held_out_views_in_part() -> None:
    """Squares cover only the held-out views in the part: distances of the target from that of each view alone."""
    rng = np.random.default_rng(3)
    errors = 1e-3 * rng.standard_normal((8, 6))
    solution = make_solution(errors)
    shift = np.array([2e-3, -1e-3, 0.0])
    moved = replace(solution.state, transforms={**solution.state.transforms, MOUNT: SE3(np.eye(3), -shift)})
    fit = SimpleNamespace(
        held=frozenset({1, 2, 5, 9}), known=np.zeros(0, dtype=bool), optimum=SimpleNamespace(state=moved)
    )
    inside = np.array([True, True, False, True, True, True, True, True])
    wanted = [np.sum((shift - SE3.exp(errors[k]).translation) ** 2) for k in (1, 5)]
    np.testing.assert_allclose(_squares(solution, fit, [inside]), wanted, rtol=1e-9)
    assert _squares(solution, fit, [np.zeros(8, dtype=bool)]).shape == (0,)


def test_part_of_one_place_has_equal_weights() -> None:
    """If the target stands still, all views have equal weights, and both fits are equal."""
    (found,) = local_fits(
        make_solution(1e-3 * np.random.default_rng(0).standard_normal((12, 6))), [MOUNT], [-1, -1, -1, 1, 1, 1]
    )
    assert found.local_m == pytest.approx(found.global_m)
    assert (found.chance, found.is_better) == (1.0, False)
