"""Local calibrations: recommended where arms bend, and not where there is noise alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.accuracy.task import local_fits as module
from basecal.accuracy.task.error_map import seen_at
from basecal.accuracy.task.local_fits import CHANCE, FEWEST_SAMPLES, MOST_PARTS, local_fits
from basecal.cell import Recording, RobotState
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate

BASE = "eye_base_from_hand_base"
WIDE = Scenario(
    samples=48, target="points", position_m=0.4, robot_noise=(1e-4, 2e-4), camera_mount="fixed", target_mount="fixed"
)


def bent(made: SimulatedCell, metres: float) -> Recording:
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


def test_noise_alone_is_best_averaged_over_all(made: SimulatedCell) -> None:
    """No part is predicted clearly better; every sample is in one part, each with enough."""
    found = local_fits(solve(made.cell, made.recording), [BASE])
    assert len(found) == MOST_PARTS
    assert sorted(number for part in found for number in part.samples) == list(range(48))
    assert all(len(part.samples) >= FEWEST_SAMPLES for part in found)
    assert all(part.local_m > 0.9 * part.global_m for part in found)
    assert not any(part.is_better for part in found)


@pytest.mark.slow
def test_differences_of_noise_alone_have_any_chance_alike() -> None:
    """Chances of forty parts without a wave are spread evenly, within what a Kolmogorov test passes at 0.1 %."""
    scenario = replace(WIDE, samples=40)
    chances = []
    for seed in range(10):
        noisy = simulate(scenario, 300 + seed)
        chances += [part.chance for part in local_fits(solve(noisy.cell, noisy.recording), [BASE])]
    assert kstest(chances[::2], "uniform").pvalue > 1e-3


def test_bent_arms_are_better_calibrated_locally(made: SimulatedCell) -> None:
    """A wave of 3 mm over the workspace: parts are recommended, and predict clearly better."""
    found = local_fits(solve(made.cell, bent(made, 3e-3)), [BASE])
    better = [part for part in found if part.is_better]
    assert better
    assert all(part.local_m < part.global_m and part.chance < CHANCE for part in better)
    assert all(np.isfinite(part.transforms[BASE].matrix).all() for part in found)


def test_few_samples_have_no_parts(made: SimulatedCell) -> None:
    few = Recording(made.recording.samples[: 2 * FEWEST_SAMPLES - 1])
    assert local_fits(solve(made.cell, few), [BASE]) == ()


def test_a_box_is_the_only_part(made: SimulatedCell) -> None:
    """Of two opposite corners, whichever they are: the samples whose targets are in it, and whether it is better."""
    solution = solve(made.cell, bent(made, 3e-3))
    halves = local_fits(solution, [BASE])
    places = np.array([seen_at(group, solution.state) for group in solution.problem.groups])[0]
    low, high = places.min(0), places.max(0)
    high[0] = np.median(places[:, 0])
    (found,) = local_fits(solution, [BASE], [*high, *low])
    inside = solution.problem.groups[0].sample[np.all((places >= low) & (places <= high), axis=-1)]
    assert found.samples == tuple(sorted(inside))
    assert FEWEST_SAMPLES < len(found.samples) < 48
    assert found.is_better == (found.chance < CHANCE and found.local_m < found.global_m)
    assert len(halves) > 1


def test_a_box_with_few_samples_is_no_part(made: SimulatedCell) -> None:
    solution = solve(made.cell, made.recording)
    assert local_fits(solution, [BASE], [5.0, 5.0, 5.0, 6.0, 6.0, 6.0]) == ()


def test_views_count_by_how_near_they_are_to_the_part(made: SimulatedCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a normal density about its middle, as wide as its own samples are spread, in three directions alike."""
    given = []

    def refitted(*arguments, worth=None):
        """As `refit_folds`, with what views count."""
        given.append(worth)
        return refit_folds(*arguments, worth=worth)

    monkeypatch.setattr(module, "refit_folds", refitted)
    solution = solve(made.cell, made.recording)
    found = local_fits(solution, [BASE])
    (group,) = solution.problem.groups
    places = seen_at(group, solution.state)
    everywhere, *parts = given
    assert everywhere is None
    assert len(parts) == len(found)
    for part, (worth,) in zip(found, parts, strict=True):
        own = places[np.isin(group.sample, part.samples)]
        np.testing.assert_allclose(part.centre_m, own.mean(0))
        reach = np.sqrt(np.mean(np.sum((own - own.mean(0)) ** 2, axis=-1)))
        away = np.linalg.norm(places - own.mean(0), axis=-1) / reach
        np.testing.assert_allclose(worth, np.exp(-(away**2) / 2))


def test_a_fit_that_did_not_settle_says_nothing(made: SimulatedCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """No errors, no chance but one, and no recommendation, whichever of the fits it is; its transforms are told."""
    few = Recording(bent(made, 3e-3).samples[:24])
    solution = solve(made.cell, few)
    box = [-9.0, -9.0, -9.0, 9.0, 9.0, 9.0]
    (settled,) = local_fits(solution, [BASE], box)
    assert settled.samples == tuple(range(24))
    assert settled.global_m is not None
    assert settled.local_m is not None
    for worth_of in (False, True):

        def refitted(*arguments, worth=None, worth_of=worth_of):
            """As `refit_folds`, the last of one kind not converged."""
            *rest, last = refit_folds(*arguments, worth=worth)
            ended = np.array(bool(last.optimum.converged) and (worth is not None) != worth_of)
            return [*rest, replace(last, optimum=replace(last.optimum, converged=ended))]

        monkeypatch.setattr(module, "refit_folds", refitted)
        (found,) = local_fits(solution, [BASE], box)
        assert (found.global_m, found.local_m, found.chance, found.is_better) == (None, None, 1.0, False)
        np.testing.assert_allclose(found.transforms[BASE].matrix, settled.transforms[BASE].matrix)
    nothing = replace(solution, problem=solution.problem.with_groups(()))
    assert local_fits(nothing, [BASE]) == ()
