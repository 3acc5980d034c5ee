"""Tests of the finding `two-mounts`: a tool frame that changed between samples, in any order."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.evidence import evidence_of

from basecal.accuracy.findings import two_mounts as room
from basecal.accuracy.findings.two_mounts import _Shifts, _splits, two_mounts
from basecal.cell import Recording
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

QUIET = {"robot_noise": (2e-4, 5e-4), "state_robot_noise": False, "state_pixel_noise": False}
OTHER = (2, 3, 7, 8, 12)


def find_two_mounts(shift_m, layout="eye_to_hand", robot="arm"):
    """Findings if some recorded poses of a robot are of a tool frame shifted along x."""
    made = simulate(Scenario(samples=14, layout=layout, **QUIET), 1)
    other = SE3(np.eye(3), np.array([shift_m, 0.0, 0.0]))
    samples = list(made.recording.samples)
    for k in OTHER:
        state = samples[k].robots[robot]
        changed = replace(state, base_from_flange=state.base_from_flange @ other)
        samples[k] = replace(samples[k], robots={**samples[k].robots, robot: changed})
    solution = solve(made.cell, Recording(tuple(samples)), Settings(robot_noise="estimated"))
    return two_mounts(evidence_of(made.cell, solution))


@pytest.mark.journey
@pytest.mark.parametrize(("layout", "robot", "mount"), [
    ("eye_to_hand", "arm", "arm_flange_from_board"), ("dual", "hand", "hand_flange_from_board"),
])  # fmt: skip
def test_both_sample_sets_are_found(layout, robot, mount):
    """Both sets of samples are found, with their distance and the samples of the smaller set."""
    (finding,) = find_two_mounts(5e-3, layout, robot)
    assert (finding.code, finding.severity, finding.about) == ("two-mounts", "warning", (mount,))
    assert "mm at samples 2, 3, 7, 8, 12." in finding.what
    assert 3.5 < float(finding.what.split(" by ")[1].split()[0]) < 6.5


def test_noise_is_no_second_mount():
    """Noise alone gives no second mount."""
    assert find_two_mounts(0.0) == []


def test_certain_effect_replaces_second_mount(evidence):
    """A certain systematic effect explains the split, so no second mount is reported."""
    certain = type("Found", (), {"is_certain": True})()
    assert two_mounts(evidence(systematic_error=certain)) == []


@pytest.mark.journey
def test_link_errors_are_no_second_mount():
    """Link errors, which the stops of an arm share, explain the split of the samples."""
    scenario = Scenario(samples=30, joints=True, link_error=(5e-4, 5e-4), **QUIET | {"robot_noise": (5e-5, 1e-4)})
    made = simulate(scenario, 0)
    solution = solve(made.cell, made.recording, Settings(robot_noise="estimated"))
    evidence = evidence_of(made.cell, solution)
    assert any(split.comparison.is_taken for split in _splits(evidence))
    assert two_mounts(evidence) == []


def shifts(rng, count):
    roots = rng.standard_normal((count, 3, 3))
    return _Shifts(np.arange(count), rng.standard_normal((count, 3)), roots @ roots.mT + np.eye(3))


def test_shifts_are_averaged_by_information():
    """Shifts are averaged by their information; squares of the first shifts are about their own mean."""
    of = shifts(np.random.default_rng(0), 6)
    for k, square in enumerate(of.squares(), start=1):
        few = of.take(np.arange(k))
        wanted = np.linalg.solve(few.information.sum(0), np.einsum("nij,nj->i", few.information, few.shift_m))
        np.testing.assert_allclose(few.mean(), wanted)
        off = few.shift_m - wanted
        assert square == pytest.approx(np.einsum("ni,nij,nj->", off, few.information, off), abs=1e-9)
    assert of.take(np.array([4, 1])).samples.tolist() == [4, 1]


@pytest.mark.parametrize(("logs", "explains", "is_so"), [(None, False, True), ((), True, True), ((), False, False)])
def test_all_splits_count_against_significance(monkeypatch, logs, explains, is_so):
    """All possible splits of the samples count against the significance.

    If noise is stated, the chance of the split is enough.
    """
    given = []
    minority, majority = (shifts(np.random.default_rng(k), count) for k, count in ((0, 3), (1, 8)))
    group = SimpleNamespace(sample=np.array([0, 2, 5]))
    moves = np.ones((3, 6, 6))
    situation = SimpleNamespace(groups=[group], frame_jacobian=lambda k, mount: moves)
    monkeypatch.setattr(room, "situate", lambda solution: situation)
    monkeypatch.setattr(room, "candidate_log_chance", lambda *words: given.append(words) or 0.5)
    monkeypatch.setattr(room, "decide", lambda gain, chance, level: SimpleNamespace(is_taken=explains))
    solution = SimpleNamespace(noise=SimpleNamespace(logs=logs))
    assert room._is_significant(solution, "mount", minority, majority) == is_so
    ((_, candidate, apart, ways),) = given
    assert ways == pytest.approx(10 * np.log(2))
    np.testing.assert_allclose(apart, minority.mean() - majority.mean())
    np.testing.assert_array_equal(candidate.moves[0][:, 0], [[[1.0] * 3] * 6, [[1.0] * 3] * 6, [[0.0] * 3] * 6])
