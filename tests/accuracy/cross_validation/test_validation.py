"""Held-out samples: the answer moves as its covariance says where that is true, and the alarm rings where it is not."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from tests.evidence import evidence_of
from tests.motion_cells import SCARA, recorded

from basecal.accuracy.cross_validation.validation import CrossValidation, HeldOutErrors, cross_validate, root_mean
from basecal.accuracy.findings.inconsistent_folds import inconsistent_folds
from basecal.accuracy.findings.not_validated import not_validated
from basecal.accuracy.findings.overfit import overfit
from basecal.cell import Cell, Finding, Recording, Validation
from basecal.estimation.least_squares import sparse_normal_equations
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_packed
from basecal.simulation import Scenario, simulate

LIGHT = Scenario(samples=25, target="led")
NOISY = Scenario(samples=15, robot_noise=(3e-4, 5e-4))


def validated(scenario: Scenario, seed: int, **told) -> tuple[Validation | None, set[str], tuple[Finding, ...]]:
    made = simulate(scenario, seed)
    cell: Cell = replace(made.cell, **told)
    if told.get("pixel_px", 0) is None:
        cell = replace(cell, robots={n: replace(r, noise=None) for n, r in cell.robots.items()})
    found, findings = checked(cell, made.recording)
    return found, {f.code for f in findings}, findings


def checked(cell: Cell, recording: Recording) -> tuple[Validation | None, tuple[Finding, ...]]:
    problem, _ = build_problem(cell, recording)
    solution = solve_packed(problem, cell)
    found = cross_validate(solution, cell.asked)
    evidence = evidence_of(cell, solution, found)
    return found and found.summary, (*not_validated(evidence), *inconsistent_folds(evidence), *overfit(evidence))


# The mean of a fold's squared change has the mean 1 and, with folds of one recording alike, 24 freedoms less those that
# the folds share: at least 12. Over 8 cells the mean's sigma is at most sqrt(2 / 96) = 0.15; 4 of them to each side.
@pytest.mark.parametrize(
    "scenario",
    [replace(NOISY, arms="stations", camera_mount="fixed", samples=25), LIGHT, NOISY],
    ids=["stations", "light", "robot noise"],
)
def test_the_answer_moves_as_its_covariance_says(scenario):
    """With true sigmas the mean square of the folds' change, in units of its covariance, is 1 within 0.6; no alarm."""
    found = [validated(scenario, seed) for seed in range(6)]
    changes = [each.base_change for each, _, _ in found if each is not None and each.base_change is not None]
    assert len(changes) == 6
    assert np.mean(changes) == pytest.approx(1.0, abs=0.6)
    assert [codes for _, codes, _ in found if codes] == []


def test_many_robots_are_validated_as_few(monkeypatch):
    """Three robots by sparse matrices: held-out errors and spread are those by dense ones, to a millionth."""
    scenario = Scenario(layout="ring", robots=3, samples=30, robot_noise=(1e-4, 1e-4))
    made = simulate(scenario, 1)
    problem, _ = build_problem(made.cell, made.recording)

    def checked_ring() -> CrossValidation:
        """Solved and validated."""
        found = cross_validate(solve_packed(problem, made.cell, Settings(robot_noise="stated")), made.cell.asked)
        assert found is not None
        return found

    dense = checked_ring()
    monkeypatch.setattr(sparse_normal_equations, "MANY_COLUMNS", 30)
    sparse = checked_ring()
    assert sparse.spread is not None
    assert dense.spread is not None
    np.testing.assert_allclose(astuple(sparse.spread), astuple(dense.spread), rtol=1e-5)
    np.testing.assert_allclose(astuple(sparse.predicted), astuple(dense.predicted), rtol=1e-5)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_robot_noise_that_is_not_modelled_is_found(arms):
    """Corners of one view share the arms' error: taken for independent noise of pixels, the answer moves too much."""
    scenario = replace(NOISY, arms=arms, camera_mount="fixed", samples=25)
    for seed in range(2):
        found, codes, _ = validated(scenario, seed, pixel_px=None)
        assert found is not None
        assert found.base_change is not None
        assert found.base_change > 5
        assert "inconsistent-folds" in codes


def test_prediction_is_that_of_the_noise():
    """Many views of a board: held-out pixels are off by the pixels' noise, within 5 %, and nearer than 1 mm."""
    found, _, _ = validated(Scenario(samples=60), 0)
    assert found is not None
    assert found.rms_px == pytest.approx(0.2, rel=0.05)
    assert found.target_m is not None
    assert found.target_m < 1e-3
    assert (found.kind, found.folds) == ("k-fold", 5)


def test_a_new_stop_is_predicted_at_its_recorded_pose():
    """Robots off by 1 mm each: held-out pixels are off by about that, though those used fit by the pixels' noise."""
    scenario = Scenario(samples=30, robot_noise=(1e-3, 0.0))
    found, _, _ = validated(scenario, 0)
    assert found is not None
    assert found.rms_px is not None
    assert found.rms_px > 3 * 0.2


def test_a_light_gives_no_pose():
    """A single light is predicted in pixels only."""
    found, _, _ = validated(LIGHT, 0)
    assert found is not None
    assert found.target_m is None
    assert found.target_rad is None
    assert found.rms_px is not None


def test_the_offset_of_a_light_moves_as_its_covariance_says():
    """Asked for alone it has three numbers, whose change is of the size of their covariance."""
    made = simulate(LIGHT, 0)
    problem, _ = build_problem(made.cell, made.recording)
    found = cross_validate(solve_packed(problem, made.cell), [made.cell.mount_name("board")])
    assert found is not None
    assert 0.05 < found.summary.base_change < 4.0


def test_a_part_that_cannot_be_missed_is_told():
    """The only sample in which the hand turns about a second axis is not held out, and the finding names it."""
    made, other = recorded(Scenario(samples=14), 0, hand=SCARA), recorded(Scenario(samples=1), 0)
    last = replace(other.recording.samples[0], sample=14, stamp_s=14.0)
    found, findings = checked(made.cell, Recording((*made.recording.samples, last)))
    assert found is not None
    assert found.folds == 4
    (told,) = findings
    assert told.code == "not-validated"
    assert "14" in told.about


def test_stations_too_few_to_miss_one_are_split():
    """Three places of the eye: without one of them nothing is seen, so that parts of places are held out instead."""
    found, codes, _ = validated(Scenario(samples=18, arms="stations", stations=3), 0)
    assert found is not None
    assert found.folds == 5
    assert codes == set()


def test_too_few_views_for_a_lens_predict_badly():
    """A lens with its distortion from five views of a board: what was held out is far off, and numbers say so."""
    made = [validated(Scenario(samples=5, intrinsics="free"), seed) for seed in range(4)]
    told = [f for _, _, findings in made for f in findings if f.code == "overfit"]
    assert told
    assert all(" px against " in f.message for f in told)


def test_no_answer_is_not_validated():
    """Where what was asked is not seen there is nothing to validate."""
    found, codes, _ = validated(Scenario(arms="eye_still"), 0)
    assert found is None
    assert codes == set()


def test_everything_fixed_is_predicted_all_the_same():
    """A cell that states every transform: pixels are predicted by the noise, and no answer can move."""
    scenario = Scenario(base="fixed", camera_mount="fixed", target_mount="fixed")
    found, codes, _ = validated(scenario, 0)
    assert found is not None
    assert found.rms_px == pytest.approx(0.2, rel=0.05)
    assert found.base_change is None
    assert codes == set()


def test_errors_of_folds_add_up():
    """Sum by sum and count by count, from nothing."""
    one, two = HeldOutErrors(1.0, 2.0, 3, 4.0, 5.0, 6), HeldOutErrors(10.0, 20.0, 30, 40.0, 50.0, 60)
    assert one + two == HeldOutErrors(11.0, 22.0, 33, 44.0, 55.0, 66)
    assert HeldOutErrors() + one == one


def test_root_of_a_mean_square():
    """None where nothing was counted, or a sum is beyond numbers."""
    assert root_mean(12.0, 3) == 2.0
    assert root_mean(12.0, 1) == np.sqrt(12.0)
    assert root_mean(12.0, 0) is None
    assert root_mean(np.inf, 3) is None


@pytest.mark.slow
def test_clean_cells_are_not_alarmed():
    """Of 400 clean cells, chance of an alarm 1e-4 each, at most one rings: two or more in 1,200 runs once."""
    scenarios = [Scenario(samples=12), LIGHT, NOISY, Scenario(samples=15, state_pixel_noise=False)]
    rung = [validated(scenarios[k % 4], k)[1] for k in range(400)]
    assert sum("inconsistent-folds" in codes for codes in rung) <= 1
