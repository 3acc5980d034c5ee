"""Tests of poses up to scale: the unit is estimated, and unobservable scale is reported."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.readings.scales import (
    _first_unit,
    _linear_factor,
    _robust_least_squares,
    _unexplained_share,
    convert_units,
    estimate_units,
)
from basecal.cell import Calibration, Cell, Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate

ARM = {"robot_noise": (1e-4, 2e-4), "target": "pose", "samples": 20}
SEEDS = 60
BAND = 3 * np.sqrt(2 / 6 / SEEDS)  # three sigmas of the mean square over 6 freedoms and SEEDS cells


def up_to_scale(made: SimulatedCell, recording: Recording, unit_m: float) -> tuple[Cell, Recording]:
    """The cell with an unknown unit, and its recording in that unit."""
    (name,) = made.cell.targets
    cell = replace(made.cell, targets={name: replace(made.cell.targets[name], size_sigma=np.inf)})
    return cell, convert_units(recording, {name: 1 / unit_m})


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["eye_in_hand", "dual"])
def test_errors_match_covariance(layout: str) -> None:
    """The mean square error of sixty cells with units from 1 mm to 1 km is 1, or 0.8 as bends count."""
    squares = []
    for seed in range(SEEDS):
        made = simulate(Scenario(layout=layout, **ARM), seed)
        found = calibrate(*up_to_scale(made, made.recording, 10 ** np.random.default_rng(seed).uniform(-3, 3)))
        name = made.cell.requested_transforms[0]
        off = (found.transforms[name].mean.inverse() @ made.truth[name]).log()
        squares.append(float(off @ np.linalg.solve(found.transforms[name].covariance, off)) / 6)
    assert 0.8 - BAND < np.mean(squares) < 1 + BAND


@cache
def in_metres() -> tuple[SimulatedCell, Calibration, Calibration]:
    """A cell of an arm, its answer with unknown unit, and with known unit."""
    made = simulate(Scenario(layout="eye_in_hand", **ARM), 3)
    return made, calibrate(*up_to_scale(made, made.recording, 1.0)), calibrate(made.cell, made.recording)


@pytest.mark.journey
@pytest.mark.parametrize("unit_m", [1e-3, 0.37, 1e3])
def test_unit_has_no_effect_on_answer(unit_m: float) -> None:
    """The answer is independent of the unit within 1 % of its sigma.

    It is wider than that of metres, and the unit is reported.
    """
    made, unknown, known = in_metres()
    name = made.cell.requested_transforms[0]
    reference, metric = unknown.transforms[name], known.transforms[name]
    found = calibrate(*up_to_scale(made, made.recording, unit_m))
    sigma = np.sqrt(np.diag(reference.covariance))
    assert np.all(np.abs((reference.mean.inverse() @ found.transforms[name].mean).log()) < 1e-2 * sigma)
    assert np.trace(found.transforms[name].covariance[:3, :3]) > 1.2 * np.trace(metric.covariance[:3, :3])
    (length,) = (each for each in found.findings if each.code == "unit-length")
    assert float(length.what.split(" is ")[1].split()[0]) == pytest.approx(1e3 * unit_m, rel=0.02)


def test_rotation_about_camera_centre_is_refused() -> None:
    """An arm that only rotates about the camera centre shows no unit; the finding advises what to record."""
    made = simulate(Scenario(layout="eye_in_hand", **{**ARM, "robot_noise": (0.0, 0.0)}), 4)
    ((robot,), (camera,), (target,)) = made.cell.robots, made.cell.cameras, made.cell.targets
    mount, world = (made.truth[made.cell.mount_name(name)] for name in (camera, target))
    samples = []
    for sample in made.recording.samples:
        turned = sample.robots[robot].base_from_flange.rotation
        pose = SE3(turned, np.array([0.4, 0.1, 0.5]) - turned @ mount.translation)
        (seen,) = sample.observations
        seen = replace(seen, camera_from_target=(pose @ mount).inverse() @ world)
        samples.append(replace(sample, robots={robot: RobotState(pose)}, observations=(seen,)))
    found = calibrate(*up_to_scale(made, replace(made.recording, samples=tuple(samples)), 0.5))
    assert found.verdict == "refused"
    (finding,) = (each for each in found.findings if each.code == "scale-unobservable")
    assert "not only turns" in finding.message


@pytest.mark.journey
def test_outliers_have_little_effect_on_unit() -> None:
    """Three of twenty poses from elsewhere are left out, and the unit is found. They affect the initial value, too."""
    made = simulate(Scenario(layout="dual", **ARM), 5)
    samples = list(made.recording.samples)
    for k in (2, 9, 16):
        samples[k] = replace(samples[k], observations=made.recording.samples[k - 1].observations)
    found = calibrate(*up_to_scale(made, replace(made.recording, samples=tuple(samples)), 7.0))
    assert {outlier.sample for outlier in found.outliers} == {2, 9, 16}
    (length,) = (each for each in found.findings if each.code == "unit-length")
    assert float(length.what.split(" is ")[1].split()[0]) == pytest.approx(7e3, rel=0.01)


def test_units_convert_named_targets_only() -> None:
    """Translations and their sigmas of the named targets are multiplied; rotations and other targets stay."""
    recording = in_metres()[0].recording
    sigma = np.array([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3])
    (view,) = recording.samples[0].observations
    views = (replace(view, sigma=sigma), replace(view, sigma=None), replace(view, target="other"))
    (sample,) = convert_units(Recording((replace(recording.samples[0], observations=views),)), {"board": 100.0}).samples
    stated, unstated, other = sample.observations
    np.testing.assert_array_equal(stated.sigma, sigma * [100, 100, 100, 1, 1, 1])
    assert unstated.sigma is None
    assert other == views[2]
    pose = stated.camera_from_target
    np.testing.assert_array_equal(pose.translation, 100 * view.camera_from_target.translation)
    np.testing.assert_array_equal(pose.rotation, view.camera_from_target.rotation)


@cache
def exact(layout: str = "dual", **more: object) -> tuple[SimulatedCell, Recording]:
    """A cell without noise, and its recording in units of 0.25 m."""
    quiet = {**ARM, "robot_noise": (0.0, 0.0), "pose_noise": (0.0, 0.0), **more}
    made = simulate(Scenario(layout=layout, **quiet), 6)  # type: ignore[arg-type]
    return made, convert_units(made.recording, {"board": 4.0})


def test_exact_poses_give_exact_unit() -> None:
    """Exact poses give the exact unit; a cell with known target sizes has none to estimate."""
    made, recording = exact()
    cell, _ = up_to_scale(made, recording, 1.0)
    units_m, findings = estimate_units(cell, recording)
    assert units_m == {"board": pytest.approx(0.25, rel=1e-6)}
    assert findings == []
    assert estimate_units(made.cell, recording) == ({}, [])


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("base", ["free", "fixed"])
def test_unit_is_linear_in_poses(layout: str, base: str) -> None:
    """With true rotations the factor is exact from any translations of unknowns.

    Known transforms are used as stated.
    """
    made, recording = exact(layout, base=base)
    problem = build_problem(made.cell, recording)[0]
    rng = np.random.default_rng(0)
    far = {
        name: replace(made.truth[name], translation=rng.uniform(-1, 1, 3)) if name in problem.columns else pose
        for name, pose in made.truth.items()
    }
    assert _linear_factor(problem, State(far, {}, np.zeros((0, 6))), "board") == pytest.approx(0.25, rel=1e-6)


def test_other_targets_do_not_affect_unit() -> None:
    """Views of other targets have no effect on a unit.

    Without views, or with arms at rest, the first unit is a metre.
    """
    made, recording = exact()
    problem = build_problem(made.cell, recording)[0]
    (group,) = problem.groups
    other = replace(group.measurement, measured_camera_from_target=SE3.identity((len(group),)))
    both = problem.with_groups([group, replace(group, target="other", measurement=other)])
    state = State(made.truth, {}, np.zeros((0, 6)))
    assert _linear_factor(both, state, "board") == pytest.approx(0.25, rel=1e-6)
    assert _first_unit(both, "board") == _first_unit(problem, "board")
    assert _linear_factor(problem, state, "other") == 1.0
    assert _first_unit(problem, "other") == 1.0
    still = group.with_ends(lambda end: replace(end, base_from_flange=SE3.identity((len(group),))))
    assert _first_unit(problem.with_groups([still]), "board") == 1.0


def test_first_unit_is_ratio_of_spreads() -> None:
    """The first unit is inverse to pose lengths and right within a factor of three.

    It is independent of the number of views.
    """
    made, recording = exact()
    first = _first_unit(build_problem(made.cell, recording)[0], "board")
    assert 0.25 / 3 < first < 0.25 * 3
    small = convert_units(recording, {"board": 1e-3})
    assert _first_unit(build_problem(made.cell, small)[0], "board") == pytest.approx(1e3 * first, rel=1e-9)
    (group,) = build_problem(made.cell, recording)[0].groups
    twice = build_problem(made.cell, recording)[0].with_groups([group, group])
    assert _first_unit(twice, "board") == pytest.approx(first, rel=1e-9)


def test_unexplained_share_is_sine_of_angle() -> None:
    """The share is 1 for an orthogonal column, 0 for one that others explain, and 0 for a zero column."""
    ahead, angle = np.array([[1.0, 0], [0, 1], [0, 0]]), np.radians(30)
    for column, share in (
        ([0, 0, 2], 1.0),
        ([3, 4, 0], 0.0),
        ([0, 0, 0], 0.0),
        ([np.cos(angle), 0, np.sin(angle)], 0.5),
    ):
        assert _unexplained_share(np.column_stack([ahead, column])) == pytest.approx(share, abs=1e-9)


def test_distant_points_hardly_count() -> None:
    """The robust mean of eleven points within millimetres ignores one a metre away."""
    points = 1e-3 * np.random.default_rng(0).standard_normal((11, 3)) + [0.1, 0.2, 0.3]
    points[4] += [0.0, 1.0, 0.0]
    found = _robust_least_squares(np.tile(np.eye(3), (11, 1)), points.ravel())
    np.testing.assert_allclose(found, [0.1, 0.2, 0.3], atol=2e-3)
