"""What a task adds to a calibration."""

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


def test_a_task_changes_nothing_but_what_is_told_of_it():
    """The same transforms and verdict; a budget, a map and parts beside them."""
    made = simulate(Scenario(samples=10, target="pose"), 2)
    plain = calibrate(made.cell, made.recording)
    told = calibrate(made.cell, made.recording, Settings(task_point=(0.4, 0.0, 0.3)))
    assert (plain.budget, plain.error_map, plain.local) == (None, None, None)
    assert told.verdict == plain.verdict
    assert told.budget
    assert len(told.error_map.points_m)
    assert told.local == ()  # ten samples have no parts
    for name, estimate in plain.transforms.items():
        assert (told[name].covariance == estimate.covariance).all()


def test_a_task_needs_something_placed():
    """A lone mount has no error at a point of the base: it is said before anything is computed."""
    lone = simulate(Scenario(samples=2, layout="eye_in_hand", target_mount="fixed"), 0)
    with pytest.raises(InputError, match="Omit the task point"):
        calibrate(lone.cell, lone.recording, Settings(task_point=(0.0, 0.0, 0.0)))


def test_what_noise_is_not_and_clocks_are_lines_of_the_budget():
    """Each by what it adds to the variance at the task; the map has both on top of the noise."""
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
    told = {entry.source: entry.rms_m for entry in found.budget}
    assert told["systematic errors: robots, lens, differing fits"] == pytest.approx(2e-3, rel=1e-3)
    assert told["offsets of clocks"] == pytest.approx(1e-3, rel=1e-3)
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


def test_the_box_holds_the_task_and_every_target(mapped):
    """Its corners are the farthest of the places where the target was, and of the task."""
    made, _, found = mapped
    base_from_board = made.true_base_from_flange["hand"] @ made.truth["hand_flange_from_board"]
    places = np.concatenate([(made.truth[BASE] @ base_from_board).translation, POINT[None]])
    assert len(found.points_m) == MAP_STEPS**3
    np.testing.assert_allclose(found.points_m.min(0), places.min(0), atol=5e-3)
    np.testing.assert_allclose(found.points_m.max(0), places.max(0), atol=5e-3)


@pytest.mark.parametrize("number", [0, MAP_STEPS**3 // 2, MAP_STEPS**3 - 1])
def test_errors_drawn_are_below_in_95_of_100(mapped, number):
    """Draws of the base by its covariance and of both robots by their noise, within three sigmas of 20,000 (0.5 %)."""
    _, calibration, found = mapped
    rng, base = np.random.default_rng(5), calibration[BASE]
    drawn = base.mean @ SE3.exp(rng.multivariate_normal(np.zeros(6), base.covariance, 20_000))
    point = found.points_m[number]
    robots = [np.repeat([3e-4, 5e-4], 3) * rng.standard_normal((20_000, 6)) for _ in range(2)]
    moved = drawn @ (base.mean.inverse() @ point) - point + robots[0][:, :3] + robots[1][:, :3]
    assert np.mean(np.linalg.norm(moved, axis=1) < found.length_95_m[number]) == pytest.approx(0.95, abs=5e-3)
    turned = (base.mean.inverse() @ drawn).log()[:, 3:] + robots[0][:, 3:] + robots[1][:, 3:]
    assert np.mean(np.linalg.norm(turned, axis=1) < found.angle_95_rad[number]) == pytest.approx(0.95, abs=5e-3)


def test_errors_smooth_in_the_pose_count(mapped):
    """A smooth error of a robot widens the map as its noise does."""
    made, calibration, found = mapped
    solution = solve(made.cell, made.recording)
    robots = dict(calibration.noise["robots"])
    robots["hand"] = {**robots["hand"], "smooth": {"sigma": [2e-3] * 3 + [1e-3] * 3, "length_m": 0.7}}
    wider = replace(calibration, noise={**calibration.noise, "robots": robots})
    larger = error_map(wider, ArmErrors(made.cell, solution, solution), POINT[None])
    assert larger.length_95_m.min() > found.length_95_m.min() + 1e-3
    assert larger.angle_95_rad[0] > found.angle_95_rad[0]


def test_a_flat_box_has_one_layer():
    """A board that stays where it is, on the world: the camera's places make the box, which the task may flatten."""
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


def test_nothing_found_has_no_map():
    """Of what is placed in the reference's base."""
    made = simulate(Scenario(samples=6), 0)
    solution = solve(made.cell, made.recording)
    assert error_map(Calibration("refused"), ArmErrors(made.cell, solution, solution), POINT[None]) is None


@pytest.mark.parametrize(("thick_m", "layers"), [(0.9e-3, 1), (1.1e-3, MAP_STEPS)])
def test_points_are_spread_over_the_box(thick_m, layers):
    """Five along each edge, from corner to corner, x first; one in the middle of an edge below a millimetre."""
    places = np.array([[1.0, -2.0, 3.0], [2.0, 0.0, 3.0 + thick_m], [1.5, -1.0, 3.0]])
    found = _box(places)
    heights = np.linspace(3.0, 3.0 + thick_m, MAP_STEPS) if layers > 1 else [3.0 + thick_m / 2]
    wanted = [(x, y, z) for x in np.linspace(1, 2, MAP_STEPS) for y in np.linspace(-2, 0, MAP_STEPS) for z in heights]
    np.testing.assert_allclose(found, wanted, atol=1e-12)
