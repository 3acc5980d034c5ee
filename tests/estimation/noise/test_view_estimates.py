"""Tests of estimates by single views, and of the scatter of their points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem
from tests.shared.real_recordings import example

from basecal.cell.targets.points import points_target
from basecal.effects.target_shape import unit_shifts
from basecal.estimation.noise.shaped_targets import shaped_points
from basecal.estimation.noise.view_estimates import view_estimates
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.estimation.view.measurement import Noise
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum
from basecal.simulation import Scenario, simulate


def test_board_view_counts_as_a_pose():
    """At the truth a view of a board has six freedoms, and its points scatter by the simulated 0.2 px."""
    s = simulate(Scenario(samples=20, state_pixel_noise=False), 1)
    problem, _ = build_problem(s.cell, s.recording)
    found = view_estimates(problem, problem.groups[0], State(s.truth, s.cameras, np.zeros((0, 6))))["pixel_px"]
    assert found.count == pytest.approx(6 * 20, rel=1e-6)
    assert np.sqrt(found.white / found.white_count) == pytest.approx(0.2, rel=0.1)
    assert found.cost.sum() / found.count == pytest.approx(0.04, rel=0.6)


@pytest.mark.journey
def test_freedoms_of_views_with_a_lens_are_smooth():
    """A change of a fortieth of a distortion term changes them by less than 0.1, while ranks jump by whole numbers."""
    cell, recording = example("ur5e_dual")
    found = solve(cell, recording)
    (group,) = found.problem.groups
    (lens,) = found.state.cameras.values()

    def freedoms(second_term: float) -> tuple[float, int]:
        changed = lens.with_parameters(lens.parameters * np.where(np.arange(9) == 5, second_term, 1.0))
        state = replace(found.state, cameras={group.camera: changed})
        of = view_estimates(found.problem, group, state, unit_shifts(shaped_points(group)))["pixel_px"]
        return of.count, int(spectrum(of.information, VIEW_ROUNDING).rank.sum())

    counts, ranks = np.array([freedoms(times) for times in np.arange(0.4, 1.6, 0.025)]).T
    assert np.abs(np.diff(ranks)).max() >= 1
    assert np.abs(np.diff(counts)).max() < 0.1


def test_stated_and_open_sigmas_are_separate_parts():
    """Half of the views state 0.5 px. Each part has only its own views, at that sigma or at unit sigma."""
    made = simulate(Scenario(samples=8, state_pixel_noise=False), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    own = np.arange(8) < 4
    stated = np.where(own[:, None] & group.measurement.seen, 2.0, 0.0)
    mixed = problem.with_groups([replace(group, measurement=replace(group.measurement, stated=stated))])
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    found = view_estimates(mixed, mixed.groups[0], state)
    assert set(found) == {"stated", "pixel_px"}
    alone = view_estimates(problem, group, state)["pixel_px"]
    for name, rows, times in (("stated", own, 2.0), ("pixel_px", ~own, 1.0)):
        some, size = found[name], np.abs(alone.information).max()
        expected = np.where(rows[:, None, None], times**2 * alone.information, 0.0)
        np.testing.assert_allclose(some.information, expected, atol=1e-9 * size)
        np.testing.assert_allclose(some.cost, np.where(rows, times**2 * alone.cost, 0.0), rtol=1e-6, atol=1e-9)
        assert some.count == pytest.approx(6 * 4, rel=1e-6)
        assert some.white_count == pytest.approx(2 * group.measurement.seen[rows].sum() - 24, rel=1e-6)
        measured = group.measurement.with_noise(Noise(pixel_px=1.0)).take(np.flatnonzero(rows))
        poses = state.camera_from_target(group, problem.stops)[np.flatnonzero(rows)]
        squares = np.sum(measured.residual_px(poses, made.cameras["wrist"]) ** 2 * measured.seen[..., None])
        assert some.white + some.cost.sum() == pytest.approx(times**2 * squares, rel=1e-6)


def test_view_cost_equals_the_gain_of_its_own_pose():
    """The cost is the decrease of its points' cost by its own pose, to first order.

    It equals a dense computation for each view.
    """
    made = simulate(Scenario(samples=5, state_pixel_noise=False), 2)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    found = view_estimates(problem, group, state)["pixel_px"]
    unit = group.measurement.with_noise(Noise(pixel_px=1.0))
    view = unit.linearise(state.camera_from_target(group, problem.stops), made.cameras["wrist"], False)
    own = np.einsum("ni,nij,nj->n", view.gradient, np.linalg.inv(view.information), view.gradient)
    np.testing.assert_allclose(found.cost, own, rtol=1e-6)
    assert found.white == pytest.approx(view.cost.sum() - own.sum(), rel=1e-6)


def test_measured_poses_have_no_scatter():
    """Each view has three freedoms of each type, all in its estimate, and parts without open sigmas are absent."""
    errors = 1e-6 * np.random.default_rng(0).standard_normal((4, 6))
    problem, state = pose_problem(errors, None)
    found = view_estimates(problem, problem.groups[0], state)
    assert set(found) == {"pose_m", "pose_rad"}
    for name, own in (("pose_m", np.repeat([1.0, 0.0], 3)), ("pose_rad", np.repeat([0.0, 1.0], 3))):
        of = found[name]
        np.testing.assert_allclose(of.cost, (own * errors**2).sum(1), rtol=1e-4)
        np.testing.assert_allclose(of.gradient, -own * errors, rtol=1e-4, atol=1e-11)
        np.testing.assert_allclose(of.information, np.tile(np.diag(own), (4, 1, 1)), atol=1e-4)
        assert of.count == pytest.approx(12.0)
        assert of.white == pytest.approx(0.0, abs=1e-16)
        assert of.white_count == pytest.approx(0.0, abs=1e-6)
    stated, state = pose_problem(errors, np.full(6, 1e-3))
    assert set(view_estimates(stated, stated.groups[0], state)) == {"stated"}
    (of,) = view_estimates(stated, stated.groups[0], state).values()
    assert of.count == pytest.approx(24.0)
    assert of.white_count == pytest.approx(0.0, abs=1e-6)


def test_body_with_free_points_has_no_scatter():
    """All of its points count. With fewer coefficients, the part unexplained by shape and pose is scatter."""
    body = points_target(0.06 * np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 1) for z in (-1, 1)]))
    made = simulate(Scenario(samples=3, target="points", board=body, state_pixel_noise=False), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    by_shape = unit_shifts(shaped_points(group))
    assert by_shape.shape == (12, 3, 36)
    of = view_estimates(problem, group, state, by_shape)["pixel_px"]
    seen = 2 * int(group.measurement.seen.sum())
    assert (of.count, of.white, of.white_count) == (seen, 0.0, 0)
    assert of.gradient.shape == (3, 42)
    unit = group.measurement.with_noise(Noise(pixel_px=1.0))
    poses = state.camera_from_target(group, problem.stops)
    squares = np.sum(unit.residual_px(poses, made.cameras["wrist"]) ** 2 * unit.seen[..., None], axis=(1, 2))
    np.testing.assert_allclose(of.cost, squares, rtol=1e-9)
    bowed = view_estimates(problem, group, state, by_shape[..., :3])["pixel_px"]
    assert bowed.gradient.shape == (3, 9)
    assert 0.0 < bowed.white < of.cost.sum()
    assert 18 < bowed.count <= 27
    assert bowed.count + bowed.white_count == pytest.approx(seen)
