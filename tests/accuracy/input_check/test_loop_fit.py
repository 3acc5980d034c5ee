"""Tests of `fit_loops`: loop closure of many hypotheses in one batch."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.declared import declared

from basecal.accuracy.input_check import loop_fit
from basecal.accuracy.input_check.hypotheses import convention_hypotheses
from basecal.accuracy.input_check.loop_fit import (
    LoopFit,
    ViewCache,
    fit_loops,
    loop_errors,
    pair_state,
    prepare_views,
    trimmed_rms,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.closed_form import Loop, Rotations
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

VIEWS = 20


def pairs_of(made, problem):
    return [(prepare_views(g, made.cameras.get(g.camera), VIEWS), problem) for g in problem.groups]


@pytest.mark.journey
@pytest.mark.parametrize("target", ["charuco", "pose", "led"])
def test_batch_fits_equal_separate_fits(target):
    """Fits of all hypotheses in one batch equal those of each alone, and only the declared one closes its loops."""
    mounts = "fixed" if target == "led" else "free"
    made = simulate(Scenario(samples=VIEWS, target=target, camera_mount=mounts, target_mount=mounts), 3)
    given = declared(made.cell, made.recording)
    hypotheses = [h for h in convention_hypotheses(given) if h.code == "robot-pose-inverted"]
    readings = [given, *(h.reread(given) for h in hypotheses)]
    pairs = [pair for each in readings for pair in pairs_of(made, each.problem)]
    together = fit_loops(pairs)
    for pair, fit in zip(pairs, together, strict=True):
        (alone,) = fit_loops([pair])
        np.testing.assert_allclose(fit.errors, alone.errors, rtol=1e-6, atol=1e-9)
    scores = [trimmed_rms(fit.errors) for fit in together]
    assert len(scores) == 4
    assert scores[0] < 0.01
    assert min(scores[1:]) > 0.05


def test_prepared_views_are_shared_by_hypotheses():
    """The view cache gives each hypothesis the views that it would get alone.

    Hypotheses that change only robots share target poses.
    """
    made = simulate(Scenario(samples=VIEWS, target="charuco"), 3)
    codes = {"robot-pose-inverted", "pairing-shifted", "length-unit"}
    given = declared(made.cell, made.recording)
    readings = [h.reread(given) for h in convention_hypotheses(given) if h.code in codes]
    ready = ViewCache(made.cameras)
    for reading in readings:
        (group,) = reading.problem.groups
        view, alone = ready.prepare(group, 12), prepare_views(group, made.cameras[group.camera], 12)
        np.testing.assert_array_equal(view.group.sample, alone.group.sample)
        np.testing.assert_array_equal(view.candidates.rotation, alone.candidates.rotation)
        for mine, theirs in zip(view.group.ends, alone.group.ends, strict=True):
            np.testing.assert_array_equal(mine.base_from_flange.translation, theirs.base_from_flange.translation)
    assert len(ready.prepared) < len(readings) / 2


def test_trimmed_rms_counts_non_finite_as_largest():
    """The trimmed rms keeps seven of ten values and counts non-finite ones as the largest.

    If more than three are lost, it is infinite.
    """
    off = np.array([3.0, 4.0, 3.0, 4.0, 3.0, 4.0, 5.0, np.nan, np.inf, 99.0])
    assert trimmed_rms(off) == pytest.approx(np.sqrt(np.mean(off[:7] ** 2)))
    assert trimmed_rms(np.append(off, [np.nan] * 4)) == np.inf
    assert trimmed_rms(np.zeros(0)) == np.inf
    assert trimmed_rms(np.array([9.0, 3.0]), 0.1) == pytest.approx(3.0)


def prepare_pair(scenario, seed=1, rows=None):
    """The only pair of a recording with prepared views, and the true X, Y and Z."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    base = group.hand.base or group.eye.base
    y = SE3.identity() if base is None else made.truth[base]
    y = y.inverse() if group.hand.base is None else y
    triple = made.truth[group.eye.mount], y, made.truth[group.hand.mount]
    return prepare_views(group, made.cameras.get(group.camera), VIEWS), problem, triple


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("target", ["charuco", "pose"])
def test_loops_close_in_all_layouts(layout, target):
    """With all transforms free, in each layout, view errors are at the noise and the fit is the truth."""
    sight, problem, truth = prepare_pair(Scenario(samples=12, target=target, layout=layout, pose_noise=(1e-4, 1e-3)))
    (fit,) = fit_loops([(sight, problem)])
    assert not fit.is_led
    assert trimmed_rms(fit.errors) < 0.01
    for found, true in zip(fit.triple, truth, strict=True):
        assert np.abs((found.inverse() @ true).log()).max() < 0.03


@pytest.mark.parametrize(
    "known", [("camera_mount",), ("target_mount",), ("base",), ("base", "camera_mount", "target_mount")]
)
def test_fixed_transforms_are_kept(known):
    """Mounts and bases that the cell states as fixed are unchanged in the fit."""
    sight, problem, truth = prepare_pair(Scenario(samples=10, **dict.fromkeys(known, "fixed")))
    (fit,) = fit_loops([(sight, problem)])
    for name, found, true in zip(("camera_mount", "base", "target_mount"), fit.triple, truth, strict=True):
        if name in known:
            np.testing.assert_allclose(found.matrix, true.matrix, atol=1e-12)
    assert trimmed_rms(fit.errors) < 0.01


def test_prior_is_not_assumed_exact():
    """A mount with a prior is estimated; only fixed ones are assumed exact."""
    sight, problem, truth = prepare_pair(Scenario(samples=10, camera_mount="prior"))
    (fit,) = fit_loops([(sight, problem)])
    assert np.abs((fit.triple[0].inverse() @ truth[0]).log()).max() > 1e-7


def test_view_errors_are_angle_and_relative_length():
    """View errors are angles, and lengths over the median distance.

    Two views are measured off by 0.3 rad and 0.2 m; of two candidates the nearer counts.
    """
    sight, _, truth = prepare_pair(Scenario(samples=6, target="pose", pose_noise=(0.0, 0.0)))
    np.testing.assert_allclose(loop_errors(sight, truth), 0.0, atol=1e-7)
    poses = sight.candidates[:, 0]
    distance = np.median(np.linalg.norm(poses.translation, axis=-1))
    shift = poses.translation.copy()
    shift[4] += [0.0, 0.2, 0.0]
    turn = SE3.exp(np.array([[0, 0, 0, 0, 0, 0.3 * (k == 2)] for k in range(6)]))
    off = SE3(poses.rotation @ turn.rotation, shift)
    both = SE3(np.stack([off.rotation] * 2, 1), np.stack([off.translation] * 2, 1))
    found = loop_errors(replace(sight, candidates=both), truth)
    assert found[2] == pytest.approx(0.3, abs=1e-6)
    assert found[4] == pytest.approx(0.2 / np.median(np.linalg.norm(shift, axis=-1)), rel=1e-6)
    assert distance > 0.3
    np.testing.assert_allclose(found[[0, 1, 3, 5]], 0.0, atol=1e-7)
    one = SE3(np.stack([off.rotation, poses.rotation], 1), np.stack([off.translation, poses.translation], 1))
    np.testing.assert_allclose(loop_errors(replace(sight, candidates=one), truth), 0.0, atol=1e-7)


def test_led_errors_are_chords_of_directions():
    """LED errors are chords between directions, and NaN in views that do not show the LED."""
    sight, _, truth = prepare_pair(Scenario(samples=8, target="led", pixel_px=0.0, state_pixel_noise=False))
    of = sight.group.measurement
    bearings, weight = of.bearings_in_camera.copy(), of.weight.copy()
    bearings[3, 0] += [0.0, 0.05, 0.0]
    weight[5] = 0.0
    changed = replace(
        sight, group=replace(sight.group, measurement=replace(of, bearings_in_camera=bearings, weight=weight))
    )
    off = loop_errors(changed, truth)
    assert off[3] == pytest.approx(0.05, abs=1e-6)
    assert np.isnan(off[5])
    np.testing.assert_allclose(off[[0, 1, 2, 4, 6, 7]], 0.0, atol=1e-6)


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand"])
def test_fit_of_single_pair_gives_state(layout):
    """The fit of a single pair gives a state: its transforms by name, the lens, and zero stop errors."""
    scenario = Scenario(samples=10, layout=layout, robot_noise=(1e-3, 1e-3))
    made = simulate(scenario, 1)
    _, problem, truth = prepare_pair(scenario)
    key = (problem.groups[0].camera, problem.groups[0].target)
    state = pair_state(problem, {key: LoopFit(truth, np.zeros(10))}, made.cameras)
    assert state is not None
    for name in problem.unknowns:
        np.testing.assert_allclose(state.transforms[name].matrix, made.truth[name].matrix, atol=1e-12)
    assert state.stop_errors.shape == (len(problem.stops), 6)
    assert state.cameras is made.cameras
    assert not state.stop_errors.any()


def test_incomplete_fits_give_no_state():
    """No state results from an LED (no rotation of its own), two pairs (two fits), or a pair without a fit."""
    _, problem, truth = prepare_pair(Scenario(samples=10))
    (group,) = problem.groups
    key = (group.camera, group.target)
    assert pair_state(problem, {key: LoopFit(truth, np.zeros(10), is_led=True)}, {}) is None
    assert pair_state(problem, {}, {}) is None
    assert pair_state(problem.with_groups([group, group]), {key: LoopFit(truth, np.zeros(10))}, {}) is None
    more = replace(problem, unknowns={**problem.unknowns, "other": problem.unknowns[group.eye.mount]})
    assert pair_state(more, {key: LoopFit(truth, np.zeros(10))}, {}) is None


def test_second_planar_pose_is_used_if_it_closes_loop():
    """The second pose of a plane is used if it closes the loop: two of twenty views have swapped candidates."""
    sight, problem, truth = prepare_pair(Scenario(samples=20))
    swapped = np.isin(np.arange(20), [3, 8])
    order = np.where(swapped[:, None], [1, 0], [0, 1])
    rows = np.arange(20)[:, None]
    turned = SE3(sight.candidates.rotation[rows, order], sight.candidates.translation[rows, order])
    (fit,) = fit_loops([(replace(sight, candidates=turned), problem)])
    assert trimmed_rms(fit.errors, 1.0) < 0.02
    for found, true in zip(fit.triple, truth, strict=True):
        assert np.abs((found.inverse() @ true).log()).max() < 0.06


@pytest.mark.parametrize(("known", "count"), [("xyz", 1), ("xz", 3), ("yz", 3), ("z", 6)])
def test_led_start_count_increases_with_unknowns(monkeypatch, known, count):
    """An LED is searched from more starts the more of the rotations X and Y are unknown. It is refined as a point."""
    asked = []
    monkeypatch.setattr(loop_fit, "led_search", lambda sight, loop, most: asked.append((loop, most)) or (1, 2, [3]))
    loop = SimpleNamespace(**{k: SE3.identity() if k in known else None for k in "xyz"})
    monkeypatch.setattr(loop_fit, "_loop", lambda sight, problem, chosen: loop)
    found = loop_fit._led_refinement(SimpleNamespace(group=range(4)), None)
    assert asked == [(loop, count)]
    assert (found.views, found.loop, found.starts, found.is_point) == (1, 2, [3], True)


def drawn_loop(known, n=8, spread=1.0, seed=0):
    """A closed loop of which some factors are known, and its true X, Y and Z."""
    rng = np.random.default_rng(seed)
    a, c = (SE3.exp(spread * rng.normal(size=(n, 6))) for _ in range(2))
    x, y, z = (SE3.exp(rng.normal(size=6)) for _ in range(3))
    b = (a @ x).inverse() @ y @ c @ z
    factors = (of if k in known else None for k, of in zip("xyz", (x, y, z), strict=True))
    return Loop(a, b, c, *factors, np.ones(n)), (x, y, z)


def test_unclear_rotations_are_searched(monkeypatch):
    """Three unknown rotations are refined on the samples and searched if they are unclear.

    Two come from the closed form.
    """
    settled, searched = [], []

    def settle(loops, near):
        settled.append((len(loops), [len(of[:3]) for of in near]))
        return list(near)

    def search(loops):
        searched.append([len(loop.a) for loop in loops])
        return [Rotations(np.eye(3), np.eye(3), np.eye(3), True) for _ in loops]

    monkeypatch.setattr(loop_fit, "refine_rotations", settle)
    monkeypatch.setattr(loop_fit, "search_rotations", search)
    cases = [drawn_loop("", 14), drawn_loop("x"), drawn_loop("", 14, seed=1), drawn_loop("xyz"), drawn_loop("xz")]
    still, _ = drawn_loop("z", 3, spread=1e-9)
    found = loop_fit._triples([*(loop for loop, _ in cases), still])
    assert settled == [(2, [3, 3])]
    assert searched == [[3]]
    for triple, (loop, true) in zip(found, cases, strict=False):
        for of, is_so in zip(triple, true, strict=True):
            np.testing.assert_allclose(of.matrix, is_so.matrix, atol=1e-6 if loop.x is not None else 1e-3)


def test_distance_uses_likelier_pose():
    """The first candidate of each view gives the distance of the target, whatever the others are."""
    sight, _, truth = prepare_pair(Scenario(samples=5, target="pose", pose_noise=(0.0, 0.0)))
    poses = sight.candidates[:, 0]
    shifted = poses.translation + np.array([0.0, 0.1, 0.0])
    far = SE3(np.stack([poses.rotation] * 2, 1), np.stack([shifted, 50 * shifted], 1))
    expected = 0.1 / np.median(np.linalg.norm(shifted, axis=-1))
    np.testing.assert_allclose(loop_errors(replace(sight, candidates=far), truth), expected, rtol=1e-6)
