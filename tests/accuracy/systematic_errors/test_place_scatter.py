"""Tests of the place scatter: changes in time are compared with errors that differ between places."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors import search
from basecal.accuracy.systematic_errors.place_scatter import PlaceScatter, Suspect, _place_splits, place_scatter
from basecal.accuracy.systematic_errors.score_tests import score
from basecal.accuracy.systematic_errors.search import systematic_error
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Recording, RobotState, Sample
from basecal.effects.faces.candidates import Candidates
from basecal.effects.step import candidates as steps
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
SETTINGS = Settings(robot_noise="stated")


def record_places(seed=0, size_m=0.0, moved=0.0):
    """Forty samples in the order of their places, with errors of the hand by place, moved in the last half."""
    scenario = Scenario(samples=40, position_m=0.3, spread_rad=0.8, robot_noise=(1e-4, 1e-4), target="pose")
    made = simulate(scenario, seed)
    rng = np.random.default_rng(seed)
    waves, shifts = rng.normal(0, 1 / 0.08, (3, 3)), rng.uniform(0, 6, 3)
    by_place = sorted(made.recording.samples, key=lambda s: s.robots["hand"].base_from_flange.translation[0])
    samples = []
    for k, sample in enumerate(by_place):
        pose = sample.robots["hand"].base_from_flange
        read = SE3(pose.rotation, pose.translation + size_m * np.sin(waves @ pose.translation + shifts))
        read = SE3.exp(moved * np.array([1, 0, 0, 0, 0, 1]) * (k >= 20)) @ read
        robots = {**sample.robots, "hand": RobotState(read)}
        samples.append(Sample(k, float(k), robots, sample.observations))
    return made.cell, Recording(tuple(samples))


def solve_places(*of, **how):
    cell, recording = record_places(*of, **how)
    problem, _ = build_problem(cell, recording)
    return solve_problem(problem, cell, SETTINGS)


def scatter_of(solution):
    """Place scatter beside the likeliest step of the base."""
    of = Situation(solution.problem, solution.state, solution.problem, {})
    (step,) = [each for each in steps(of) if each.about[0] == BASE]
    best = int(np.argmax(score(of.linearisation, step).statistic))
    return place_scatter(of, of.linearisation, step.single(best))


@pytest.mark.journey
@pytest.mark.parametrize("moved", [0.0, 3e-3])
def test_noise_has_no_place_scatter(moved):
    """Noise alone gives a ratio below 1.4 in four cells, with some 70 freedoms. A moved base is no scatter."""
    # With 70 freedoms or more the sigma of the ratio is at most 0.17: one in fifty exceeds 1.4.
    found = [scatter_of(solve_places(seed, moved=moved)) for seed in range(4)]
    assert all(1.0 <= each.ratio < 1.4 for each in found)
    assert all(40 < each.freedoms < 130 for each in found)


@pytest.mark.journey
def test_errors_by_place_increase_scatter():
    """Errors of 5 mm between places scatter more than three times as much as noise."""
    assert min(scatter_of(solve_places(seed, 5e-3)).ratio for seed in range(4)) > 3.0


def test_single_place_has_no_scatter(monkeypatch):
    """A recording whose flanges stay at one place cannot be split by place."""
    solution = solve_places()
    stay = np.zeros((40, 24))
    monkeypatch.setattr("basecal.accuracy.systematic_errors.place_scatter.flange_poses", lambda _: stay)
    assert scatter_of(solution) == PlaceScatter()


def find_effect_code(seed, **how):
    cell, recording = record_places(seed, **how)
    problem, _ = build_problem(cell, recording)
    stamps = {each.sample: each.stamp_s for each in recording.samples}
    found = systematic_error(solve_problem(problem, cell, SETTINGS), problem, stamps, SETTINGS)
    return None if found is None or not found.is_certain else found.code


@pytest.mark.journey
def test_errors_by_place_are_no_change_in_time(monkeypatch):
    """Errors by place look like steps and drifts if the recording moves from place to place.

    Without the scatter they are named.
    """
    seeds = range(6)
    assert not {find_effect_code(seed, size_m=5e-3) for seed in seeds} & {"base-moved", "drift"}
    monkeypatch.setattr(search, "CHANGES_IN_TIME", ())
    assert {find_effect_code(seed, size_m=5e-3) for seed in seeds} & {"base-moved", "drift"}


@pytest.mark.journey
def test_moved_base_is_named_despite_ordered_places():
    """A base moved by 10 mm and 10 mrad is named in each of four cells.

    One of them sees its target only to some millimetres.
    """
    assert [find_effect_code(seed, moved=1e-2) for seed in range(4)] == ["base-moved"] * 4


def test_change_is_compared_with_scatter():
    """A change is compared with the scatter by Fisher's ratio, and by chi-square if noise is alone."""
    assert PlaceScatter().log_chance(30.0, 6) < PlaceScatter(1.0, 50.0).log_chance(30.0, 6)
    assert PlaceScatter(2.0, 50.0).log_chance(30.0, 6) == PlaceScatter(1.0, 50.0).log_chance(15.0, 6)


ONE = Suspect(
    "step", Candidates("base-moved", ("a",), (3,), "", (None,)), np.zeros(6), 6, 60.0, -20.0, -22.0, np.log(32)
)


def test_rank_includes_number_of_candidates():
    """The rank of a suspect increases by half the logarithm of the number of candidates."""
    assert ONE.rank == pytest.approx(-22.0 + 0.5 * np.log(32))


def test_change_in_time_uses_larger_of_score_and_gain():
    """The larger of score and gain of a change in time is compared with the place scatter.

    Other errors keep their chance.
    """
    moved = replace(ONE, scatter=PlaceScatter(2.0, 50.0))
    assert ONE.log_chance_beside_places(90.0, -31.0) == -31.0
    assert moved.log_chance_beside_places(10.0, -31.0) == pytest.approx(
        PlaceScatter(1.0, 50.0).log_chance(30.0, 6) + np.log(32)
    )
    assert moved.log_chance_beside_places(90.0, -31.0) == pytest.approx(
        PlaceScatter(1.0, 50.0).log_chance(45.0, 6) + np.log(32)
    )


def test_places_are_split_into_thirds(monkeypatch):
    """Places are split into thirds along each direction of flange motion, by the samples that show the frame.

    Other samples are on either side.
    """
    poses = np.zeros((10, 1, 12))
    poses[:, 0, 0] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 100]
    poses[:, 0, 1] = 0.1 * np.array([0, 1, 0, 1, 0, 1, 0, 1, 0, 1])
    groups = [SimpleNamespace(rows=np.arange(9)), SimpleNamespace(rows=np.array([9]))]
    situation = SimpleNamespace(
        groups=groups, samples=np.arange(10), sample_indices=lambda group: group.rows, depends=lambda k, name: k == 0
    )
    monkeypatch.setattr("basecal.accuracy.systematic_errors.place_scatter.flange_poses", lambda _: 5 + poses)
    found = _place_splits(situation, "base")
    assert found.shape == (10, 4)
    sides = [set(np.flatnonzero(found[:9, k] == found[8, k]).tolist()) for k in (0, 2)]
    assert sorted(map(len, sides)) == [3, 6]
    assert {8, 7, 6} == min(sides, key=len)
    assert (found[9, [0, 2]] == found[8, [0, 2]]).all()
