"""Tests of the finding `prior-contradicted`."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.touch_cells import MARKS, recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.prior_contradicted import _wider_entry, contradicted_priors, innovation_covariance
from basecal.accuracy.fixing.offers import offered_places
from basecal.effects import deflection
from basecal.effects.link_parameters import Stated
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

TOLD = Scenario(samples=12, target="points", camera_mount="prior", target_mount="prior", base="prior")
MOUNT = "eye_flange_from_wrist"


@pytest.mark.journey
@pytest.mark.parametrize("intrinsics", ["fixed", "prior"])
def test_true_priors_are_not_contradicted(intrinsics):
    """Ten cells with priors drawn as stated give no finding; by chance one in 250 such tests does."""
    for seed in range(10):
        s = simulate(replace(TOLD, intrinsics=intrinsics), seed)
        assert contradicted_priors(s.cell, solve(s.cell, s.recording)) == []


@pytest.mark.journey
def test_wrong_prior_is_named():
    """A mount stated eight sigmas off is contradicted by name, and the verdict is doubtful."""
    s = simulate(TOLD, 0)
    (camera,) = s.cell.cameras.values()
    off = SE3.exp(np.array([8 * camera.mount.sigma[0], 0, 0, 0, 0, 0]))
    mount = replace(camera.mount, mean=s.truth[MOUNT] @ off)
    cell = replace(s.cell, cameras={camera.name: replace(camera, mount=mount)})
    calibration = calibrate(cell, s.recording)
    findings = [f for f in calibration.findings if f.code == "prior-contradicted"]
    assert [f.about for f in findings] == [(MOUNT,)]
    assert findings[0].do[-1] == "`basecal fix CELL` makes it free."
    assert calibration.verdict == "doubtful"


def test_prior_without_data_is_not_judged():
    """A prior that the data do not test is not judged: with a still eye, mount and base compensate each other."""
    s = simulate(replace(TOLD, arms="eye_still", base="free", target_mount="fixed"), 0)
    (camera,) = s.cell.cameras.values()
    mount = replace(camera.mount, mean=camera.mount.mean @ SE3.exp(np.array([0.1, 0, 0, 0, 0, 0])))
    cell = replace(s.cell, cameras={camera.name: replace(camera, mount=mount)})
    assert contradicted_priors(cell, solve(cell, s.recording)) == []


def test_wrong_lens_prior_is_named():
    """A focal length stated 60 px too long with a sigma of 5 px is named; `fix` frees the lens."""
    s = simulate(Scenario(samples=12, intrinsics="prior"), 1)
    wrist = s.cell.cameras["wrist"]
    longer = replace(wrist.intrinsics.camera, parameters=wrist.intrinsics.camera.parameters + np.eye(9)[0] * 60)
    cell = replace(s.cell, cameras={"wrist": replace(wrist, intrinsics=replace(wrist.intrinsics, camera=longer))})
    (finding,) = contradicted_priors(cell, solve(cell, s.recording))
    assert finding.about == ("wrist",)
    assert "sigmas away from the prior of the lens of wrist." in finding.what
    assert finding.do[-1] == "`basecal fix CELL` makes it free."


@pytest.mark.parametrize(("kind", "faults", "sigmas"), [
    ("joint_offsets", {"joint_offset_rad": 0.02}, {"sigma_rad": 0.002}),
    ("link_parameters", {"link_error": (2e-3, 2e-3)}, {"sigma_rad": 2e-4, "sigma_m": 2e-4}),
])  # fmt: skip
def test_wrong_robot_priors_get_wider_entries(kind, faults, sigmas):
    """Robot priors with a tenth of the true sigmas are named with a wider entry.

    Its sigma grows by the distance in sigmas, at least twofold.
    """
    s = simulate(Scenario(samples=30, joints=True, **faults, **{kind: "prior"}), 1)
    robots = {}
    for name, robot in s.cell.robots.items():
        narrow = robot.parameters[kind].model_copy(update=sigmas)
        robots[name] = replace(robot, parameters={**robot.parameters, kind: narrow})
    cell = replace(s.cell, robots=robots)
    found = contradicted_priors(cell, solve(cell, s.recording))
    assert {finding.about for finding in found} == {("eye",), ("hand",)}
    for finding in found:
        (robot,) = finding.about
        (away,) = re.findall(rf"up to ([\d.]+) sigmas away from the prior of {kind} of {robot}\.", finding.what)
        factor = max(2, np.ceil(float(away)))
        wider = {key: pytest.approx(factor * sigma, rel=0.06) for key, sigma in sigmas.items()}
        assert offered_places(cell, finding) == {("robots", robot, kind): {"status": "prior", **wider}}


def test_mark_without_entry_is_not_freed():
    """A plate mark 3 mm off has no entry of its own, so no fix is offered."""
    points = {**{name: place.tolist() for name, place in MARKS.items()}, "mark_d": [0.5, 0.0, 0.1]}
    wrong = {**points, "mark_b": [points["mark_b"][0] + 3e-3, *points["mark_b"][1:]]}
    cell = touch_cell((), marks={"plate": {"points_m": wrong}})
    places = {name: np.array(place) for name, place in points.items()}
    findings = contradicted_priors(
        cell, solve(cell, recorded(cell, touch_lines(np.random.default_rng(0), 40, 1e-4, places)))
    )
    assert any(finding.about == ("plate_from_mark_b",) for finding in findings)
    assert all("basecal fix" not in finding.message for finding in findings)


@pytest.mark.parametrize("wider", [[1.0, 1.0, 1.0], [2.0, 1.0, 5.0]])
def test_innovation_covariance_is_independent_of_priors(wider):
    """Estimates vary as data under unit priors do.

    Data d have covariance I + P^-1, and the estimate from them is C P d, whatever priors are in use.
    """
    root = np.random.default_rng(0).standard_normal((3, 3))
    by_data, wider = root @ root.T, np.array(wider)
    covariance = np.linalg.inv(by_data + np.diag(wider**-2))
    gain = covariance @ by_data
    expected = gain @ (np.eye(3) + np.linalg.inv(by_data)) @ gain.T
    np.testing.assert_allclose(innovation_covariance(covariance, wider), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("sigmas", "sigma_m", "sigma_rad"), [(1.5, 2e-3, 4e-3), (2.0, 2e-3, 4e-3), (2.1, 3e-3, 6e-3), (7.9, 8e-3, 0.016)]
)
def test_wider_entries_contain_value(sigmas, sigma_m, sigma_rad):
    """Wider entries have as many times the sigma as the value is away, rounded up, at least twofold.

    Fields that are not stated are not written.
    """
    stated = Stated(status="prior", sigma_m=1e-3, sigma_rad=2e-3)
    entry = f"`link_parameters: {{status: prior, sigma_rad: {sigma_rad}, sigma_m: {sigma_m}}}`"
    assert _wider_entry("link_parameters", stated, sigmas) == entry
    alone = deflection.Stated(status="prior", sigma_rad_per_nm=1e-3)
    entry = f"`deflection: {{status: prior, sigma_rad_per_nm: {sigma_m}}}`"
    assert _wider_entry("deflection", alone, sigmas) == entry
