"""Tests of the error at the task: budget, error map and local fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.task_error import MAP_STEPS, _box, add_task_error, error_map
from basecal.cell import Calibration
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.mark.journey
def test_task_only_adds_its_fields():
    """A task adds a budget, a map and local fits; transforms and verdict are unchanged."""
    made = simulate(Scenario(samples=10, target="pose"), 2)
    plain = calibrate(made.cell, made.recording)
    with_task = calibrate(made.cell, made.recording, Settings(task_point=(0.4, 0.0, 0.3)))
    assert (plain.budget, plain.error_map, plain.local) == (None, None, None)
    assert with_task.verdict == plain.verdict
    assert with_task.budget
    assert len(with_task.error_map.points_m)
    assert with_task.local == ()  # ten samples have no parts
    for name, estimate in plain.transforms.items():
        assert (with_task[name].covariance == estimate.covariance).all()


def test_task_needs_placed_transform():
    """A cell with only a mount has no error at a point of the base: an InputError before any computation."""
    lone = simulate(Scenario(samples=2, layout="eye_in_hand", target_mount="fixed"), 0)
    with pytest.raises(InputError, match="Omit the task point"):
        calibrate(lone.cell, lone.recording, Settings(task_point=(0.0, 0.0, 0.0)))


@pytest.mark.journey
def test_widening_and_clocks_are_budget_lines():
    """Systematic errors and clocks are budget lines with their variance at the task; the map adds both to the noise."""
    made = simulate(Scenario(samples=10, target="pose", robot_noise=(1e-4, 2e-4)), 2)
    calibration, fitted = calibrate(made.cell, made.recording), solve(made.cell, made.recording)
    base = fitted.problem.columns[BASE].start
    model, clocks = np.zeros_like(fitted.covariance), np.zeros_like(fitted.covariance)
    model[base, base], clocks[base + 1, base + 1] = 4e-6, 1e-6  # 2 mm along x and 1 mm along y
    modelled = replace(fitted, covariance=fitted.covariance + model)
    every = replace(modelled, covariance=modelled.covariance + clocks)
    own = calibration[BASE]
    wide = own.covariance + np.diag([4e-6, 1e-6, 0, 0, 0, 0])
    stated = replace(calibration, transforms={**calibration.transforms, BASE: replace(own, covariance=wide)})
    found = add_task_error(made.cell, stated, Settings(task_point=(0.4, 0.0, 0.3)), (fitted, modelled, every), None)
    rms_by_source = {entry.source: entry.rms_m for entry in found.budget}
    assert rms_by_source["systematic errors: robots, lens, differing fits"] == pytest.approx(2e-3, rel=1e-3)
    assert rms_by_source["offsets of clocks"] == pytest.approx(1e-3, rel=1e-3)
    plain = add_task_error(made.cell, calibration, Settings(task_point=(0.4, 0.0, 0.3)), (fitted, fitted, fitted), None)
    assert not {"offsets of clocks", "systematic errors: robots, lens, differing fits"} & {
        entry.source for entry in plain.budget
    }
    assert np.all(found.error_map.length_95_m > plain.error_map.length_95_m)
    np.testing.assert_allclose(found.error_map.angle_95_rad, plain.error_map.angle_95_rad, rtol=1e-6)


POINT = np.array([0.5, 0.1, 0.3])


@pytest.fixture(scope="module")
def mapped():
    made = simulate(Scenario(samples=15, robot_noise=(3e-4, 5e-4)), 4)
    calibration = calibrate(made.cell, made.recording, Settings(task_point=tuple(POINT)))
    return made, calibration, calibration.error_map


def test_map_box_contains_task_and_targets(mapped):
    """The corners of the map's box are the extremes of target places and task."""
    made, _, found = mapped
    base_from_board = made.true_base_from_flange["hand"] @ made.truth["hand_flange_from_board"]
    places = np.concatenate([(made.truth[BASE] @ base_from_board).translation, POINT[None]])
    assert len(found.points_m) == MAP_STEPS**3
    np.testing.assert_allclose(found.points_m.min(0), places.min(0), atol=5e-3)
    np.testing.assert_allclose(found.points_m.max(0), places.max(0), atol=5e-3)


@pytest.mark.parametrize("number", [0, MAP_STEPS**3 // 2, MAP_STEPS**3 - 1])
def test_map_error_is_95_percent_quantile(mapped, number):
    """Draws of the base and of both robots' noise are below the map in 95 %, within three sigmas of 20,000 (0.5 %)."""
    _, calibration, found = mapped
    rng, base = np.random.default_rng(5), calibration[BASE]
    drawn = base.mean @ SE3.exp(rng.multivariate_normal(np.zeros(6), base.covariance, 20_000))
    point = found.points_m[number]
    robots = [np.repeat([3e-4, 5e-4], 3) * rng.standard_normal((20_000, 6)) for _ in range(2)]
    moved = drawn @ (base.mean.inverse() @ point) - point + robots[0][:, :3] + robots[1][:, :3]
    assert np.mean(np.linalg.norm(moved, axis=1) < found.length_95_m[number]) == pytest.approx(0.95, abs=5e-3)
    turned = (base.mean.inverse() @ drawn).log()[:, 3:] + robots[0][:, 3:] + robots[1][:, 3:]
    assert np.mean(np.linalg.norm(turned, axis=1) < found.angle_95_rad[number]) == pytest.approx(0.95, abs=5e-3)


def test_smooth_errors_widen_map(mapped):
    """A smooth error of a robot widens the map as its noise does."""
    made, calibration, found = mapped
    solution = solve(made.cell, made.recording)
    robots = dict(calibration.noise["robots"])
    robots["hand"] = {**robots["hand"], "smooth": {"sigma": [2e-3] * 3 + [1e-3] * 3, "length_m": 0.7}}
    wider = replace(calibration, noise={**calibration.noise, "robots": robots})
    larger = error_map(wider, ArmErrors(made.cell, solution, solution), POINT[None])
    assert larger.length_95_m.min() > found.length_95_m.min() + 1e-3
    assert larger.angle_95_rad[0] > found.angle_95_rad[0]


def test_flat_box_has_one_layer():
    """A box flattened by the task has one layer. If the board is on the world, the camera's places make the box."""
    made = simulate(Scenario(samples=10, layout="eye_in_hand", robot_noise=(1e-4, 1e-4)), 1)
    calibration = calibrate(made.cell, made.recording, Settings(task_point=(0.0, 0.0, 0.3)))
    assert len(calibration.error_map.points_m) == MAP_STEPS**3
    solution = solve(made.cell, made.recording)
    (group,) = solution.problem.groups
    few = replace(solution, problem=solution.problem.with_groups([group.take(np.array([2]))]))
    at = (group.eye.base_from_flange @ solution.state.transforms["arm_flange_from_wrist"]).translation[2]
    assert (
        len(error_map(calibration, ArmErrors(made.cell, few, few), (at + np.array([0.1, 0, 0]))[None]).points_m)
        == MAP_STEPS
    )


def test_missing_transform_has_no_map():
    """Without a transform placed in the reference's base there is no map."""
    made = simulate(Scenario(samples=6), 0)
    solution = solve(made.cell, made.recording)
    assert error_map(Calibration("refused"), ArmErrors(made.cell, solution, solution), POINT[None]) is None


@pytest.mark.parametrize(("thick_m", "layers"), [(0.9e-3, 1), (1.1e-3, MAP_STEPS)])
def test_map_points_are_spread_over_box(thick_m, layers):
    """Five points are spread along each edge from corner to corner, x first.

    An edge below a millimetre has one in its middle.
    """
    places = np.array([[1.0, -2.0, 3.0], [2.0, 0.0, 3.0 + thick_m], [1.5, -1.0, 3.0]])
    found = _box(places)
    heights = np.linspace(3.0, 3.0 + thick_m, MAP_STEPS) if layers > 1 else [3.0 + thick_m / 2]
    wanted = [(x, y, z) for x in np.linspace(1, 2, MAP_STEPS) for y in np.linspace(-2, 0, MAP_STEPS) for z in heights]
    np.testing.assert_allclose(found, wanted, atol=1e-12)
