"""Tests of point residuals from a stored calibration."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals.point_residuals import point_residuals
from basecal.cell import Calibration, Outlier
from basecal.cell.cell import Status
from basecal.cell.files import calibration_from_dict, calibration_to_dict
from basecal.estimation.settings import Settings
from basecal.simulation.scenario import Arms, Scenario, SimulatedCell
from basecal.simulation.testbed import simulate


@pytest.mark.journey
@pytest.mark.parametrize(
    ("arms", "robot_noise", "intrinsics"),
    [
        ("both", (3e-4, 5e-4), "free"),
        ("stations", (3e-4, 5e-4), "fixed"),
        pytest.param("stations", (0.0, 0.0), "free", marks=pytest.mark.slow),
    ],
)
def test_stored_calibration_reproduces_rms(arms: Arms, robot_noise: tuple[float, float], intrinsics: Status) -> None:
    """The rms over points from the stored numbers equals that of the solver, also with robot noise."""
    made = simulate(Scenario(samples=15, arms=arms, robot_noise=robot_noise, intrinsics=intrinsics), 3)
    calibration = calibrate(made.cell, made.recording)
    stored = calibration_from_dict(calibration_to_dict(calibration))
    off = np.concatenate([each.off_px.ravel() for each in point_residuals(made.cell, made.recording, stored)])
    assert float(np.sqrt(np.mean(off**2))) == pytest.approx(
        calibration.residuals.rms_px, rel=1e-3
    )  # residuals of the fit, without mount bend


@pytest.mark.journey
def test_stored_noise_reproduces_rms() -> None:
    """The rms is reproduced with stored estimated robot noise, too."""
    made = simulate(Scenario(samples=15, robot_noise=(3e-4, 5e-4), state_robot_noise=False), 3)
    calibration = calibrate(made.cell, made.recording)
    stored = calibration_from_dict(calibration_to_dict(calibration))
    off = np.concatenate([each.off_px.ravel() for each in point_residuals(made.cell, made.recording, stored)])
    assert float(np.sqrt(np.mean(off**2))) == pytest.approx(
        calibration.residuals.rms_px, rel=1e-3
    )  # residuals of the fit, without mount bend
    assert calibration.residuals.rms_px == pytest.approx(0.2, rel=0.15)


@pytest.mark.journey
@pytest.mark.parametrize(
    "known",
    [
        {"joint_offset_rad": 0.004, "joint_offsets": "free"},
        {"link_error": (5e-4, 1e-3), "link_parameters": "prior", "compliance": 1e-4, "deflection": "prior"},
    ],
)
def test_stored_robot_parameters_reproduce_rms(known: dict[str, Any]) -> None:
    """Joint offsets, link errors and compliances are taken from the stored numbers, too."""
    made = simulate(Scenario(samples=20, joints=True, robot_noise=(1e-4, 1e-4), **known), 3)
    calibration = calibrate(made.cell, made.recording)
    stored = calibration_from_dict(json.loads(json.dumps(calibration_to_dict(calibration))))
    (points,) = point_residuals(made.cell, made.recording, stored)
    assert float(np.sqrt(np.mean(points.off_px**2))) == pytest.approx(
        calibration.residuals.rms_px, rel=1e-3
    )  # residuals of the fit, without mount bend
    as_stated = replace(stored, robot_parameters={})
    (points,) = point_residuals(made.cell, made.recording, as_stated)
    assert float(np.sqrt(np.mean(points.off_px**2))) > 1.1 * calibration.residuals.rms_px


@pytest.fixture(scope="module")
def exact() -> tuple[SimulatedCell, Calibration]:
    """A cell whose robots are assumed exact and do not follow a single point."""
    made = simulate(Scenario(samples=12), 5)
    return made, calibrate(made.cell, made.recording, Settings(robot_noise="stated"))


def test_residual_is_predicted_minus_observed(exact: tuple[SimulatedCell, Calibration]) -> None:
    """A point moved by (1, -2) px has its residual moved by (-1, 2) px; no other point changes."""
    made, calibration = exact
    sample = made.recording.samples[4]
    seen = sample.observations[0]
    pixels = np.array(seen.pixels)
    pixels[7] += (1.0, -2.0)
    moved = replace(sample, observations=(replace(seen, pixels=pixels),))
    samples = (*made.recording.samples[:4], moved, *made.recording.samples[5:])
    before = point_residuals(made.cell, made.recording, calibration)[0]
    after = point_residuals(made.cell, replace(made.recording, samples=samples), calibration)[0]
    change = after.off_px - before.off_px
    here = (after.sample == sample.sample) & (after.ids == seen.ids[7])
    np.testing.assert_allclose(change[here], [[-1.0, 2.0]], atol=1e-9)
    np.testing.assert_allclose(change[~here], 0.0, atol=1e-9)


def test_missing_transforms_omit_views(exact: tuple[SimulatedCell, Calibration]) -> None:
    """Views without their transforms have no residuals."""
    made, calibration = exact
    without = {n: e for n, e in calibration.transforms.items() if n != "hand_flange_from_board"}
    assert point_residuals(made.cell, made.recording, replace(calibration, transforms=without)) == ()


def test_outliers_are_marked_as_unused(exact: tuple[SimulatedCell, Calibration]) -> None:
    """A left-out view and left-out points of another view are marked as unused."""
    made, calibration = exact
    outliers = (Outlier(2, "wrist", "board", (), "bumped"), Outlier(5, "wrist", "board", (3, 4), "reflection"))
    (points,) = point_residuals(made.cell, made.recording, replace(calibration, outliers=outliers))
    left_out = {(int(s), int(i)) for s, i in zip(points.sample[~points.used], points.ids[~points.used], strict=True)}
    assert {sample for sample, _ in left_out} == {2, 5}
    assert not np.any(points.used[points.sample == 2])
    assert {point for sample, point in left_out if sample == 5} == {3, 4}
