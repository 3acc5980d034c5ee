"""Poses up to scale: their unit is found, the answer is that of metres, and what hides it is said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.readings.scales import convert_units
from basecal.cell import Calibration, Cell, Recording, RobotState
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate

ARM = {"robot_noise": (1e-4, 2e-4), "target": "pose", "samples": 20}
SEEDS = 60
BAND = 3 * np.sqrt(2 / 6 / SEEDS)  # three sigmas of the mean of so many squares over 6


def up_to_scale(made: SimulatedCell, recording: Recording, unit_m: float) -> tuple[Cell, Recording]:
    """The cell that does not know the unit, and what was recorded in it."""
    (name,) = made.cell.targets
    cell = replace(made.cell, targets={name: replace(made.cell.targets[name], size_sigma=np.inf)})
    return cell, convert_units(recording, {name: 1 / unit_m})


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["eye_in_hand", "dual"])
def test_answers_are_as_true_as_they_say(layout: str) -> None:
    """Sixty cells of units from a millimetre to a kilometre: the mean square of errors is 1, or 0.8 as bends count."""
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
    """A cell of an arm, its answer without its unit, and its own."""
    made = simulate(Scenario(layout="eye_in_hand", **ARM), 3)
    return made, calibrate(*up_to_scale(made, made.recording, 1.0)), calibrate(made.cell, made.recording)


@pytest.mark.parametrize("unit_m", [1e-3, 0.37, 1e3])
def test_the_unit_does_not_matter(unit_m: float) -> None:
    """The answer is the same to a hundredth of its sigma, wider than that of metres, and the unit is told."""
    made, unknown, known = in_metres()
    name = made.cell.requested_transforms[0]
    reference, metric = unknown.transforms[name], known.transforms[name]
    found = calibrate(*up_to_scale(made, made.recording, unit_m))
    sigma = np.sqrt(np.diag(reference.covariance))
    assert np.all(np.abs((reference.mean.inverse() @ found.transforms[name].mean).log()) < 1e-2 * sigma)
    assert np.trace(found.transforms[name].covariance[:3, :3]) > 1.2 * np.trace(metric.covariance[:3, :3])
    (length,) = (each for each in found.findings if each.code == "unit-length")
    assert float(length.what.split(" is ")[1].split()[0]) == pytest.approx(1e3 * unit_m, rel=0.02)


def test_an_arm_that_only_turns_is_refused() -> None:
    """About the camera's own centre: no unit shows, and it is said what to record."""
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


def test_gross_errors_hardly_move_the_unit() -> None:
    """Three of twenty poses from elsewhere, which turn the start, too: the answer leaves them out and has the unit."""
    made = simulate(Scenario(layout="dual", **ARM), 5)
    samples = list(made.recording.samples)
    for k in (2, 9, 16):
        samples[k] = replace(samples[k], observations=made.recording.samples[k - 1].observations)
    found = calibrate(*up_to_scale(made, replace(made.recording, samples=tuple(samples)), 7.0))
    assert {outlier.sample for outlier in found.outliers} == {2, 9, 16}
    (length,) = (each for each in found.findings if each.code == "unit-length")
    assert float(length.what.split(" is ")[1].split()[0]) == pytest.approx(7e3, rel=0.01)
