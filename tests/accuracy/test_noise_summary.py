"""Tests of `noise_summary`: stated and estimated noise of each device."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.noise_summary import _camera_noise, _rms_of_cameras, noise_summary
from basecal.cell import Recording
from basecal.cell.results.calibration_dict import calibration_from_dict, calibration_to_dict
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.estimation.view.measurement import Noise
from basecal.reporting.text import noise_sentences
from basecal.simulation import Scenario, simulate

STATED = simulate(Scenario(samples=12, robot_noise=(2e-4, 4e-4)), 2)
BARE = simulate(Scenario(samples=14, robot_noise=(2e-4, 4e-4), state_robot_noise=False, state_pixel_noise=False), 2)


def with_detector_sigma(recording, sigma_px):
    """The recording as if a detector had stated a sigma of all corners."""

    def of(seen):
        return replace(seen, sigma_px=np.full(len(seen.ids), sigma_px), detected=True)

    samples = (replace(s, observations=tuple(map(of, s.observations))) for s in recording.samples)
    return Recording(tuple(samples))


def test_stated_noise_is_listed():
    """With stated noise the pixel sigma of the cell and the sigmas of robots are listed, none as a camera's own."""
    found = noise_summary(STATED.cell, STATED.recording, solve(STATED.cell, STATED.recording))
    assert found["pixel_px"] == STATED.cell.pixel_px
    assert "cameras" not in found
    assert found["robots"]["hand"] == {"sigma_t_m": [2e-4] * 3, "sigma_r_rad": [4e-4] * 3}


@pytest.mark.journey
def test_estimated_sigma_is_compared_with_detector():
    """Noise of 0.2 px is four times the 0.05 px that the detector states, within the error of 300 corners."""
    recording = with_detector_sigma(BARE.recording, 0.05)
    solution = solve(BARE.cell, recording, Settings(robot_noise="estimated"))
    of = noise_summary(BARE.cell, recording, solution)["cameras"]["wrist"]
    assert of["pixel_px"] == pytest.approx(0.2, rel=0.15)
    assert of["factor"] == pytest.approx(of["pixel_px"] / 0.05)
    assert of["views_count"] == 14
    assert noise_summary(BARE.cell, BARE.recording, solution)["cameras"]["wrist"]["factor"] is None


@pytest.mark.journey
@pytest.mark.parametrize("by_poses", ["left_camera", "right_camera"])
def test_view_sigma_uses_cameras_that_have_it(by_poses):
    """A view sigma is that of the cameras that have it, pixels or poses in either order; of two, the rms."""
    bare = Scenario(samples=12, layout="two_cameras", state_pixel_noise=False, state_observation_noise=False)
    pixels, poses = (simulate(replace(bare, target=target), 1) for target in ("charuco", "pose"))
    samples = (
        replace(s, observations=tuple(o if o.camera != by_poses else p for o, p in zip(*pair, strict=True)))
        for s, t in zip(pixels.recording.samples, poses.recording.samples, strict=True)
        for pair in [(s.observations, t.observations)]
    )
    mixed = Recording(tuple(samples))
    found = noise_summary(pixels.cell, mixed, solve(pixels.cell, mixed, Settings(robot_noise="estimated")))
    other = ({"left_camera", "right_camera"} - {by_poses}).pop()
    assert found["pixel_px"] == found["cameras"][other]["pixel_px"]
    assert found["pose_m"] == found["cameras"][by_poses]["pose_m"]
    of_two = {"a": {"pixel_px": 0.3}, "b": {"pixel_px": 0.4}, "c": {}}
    assert _rms_of_cameras(of_two, "pixel_px", 1.0) == pytest.approx(0.125**0.5)


def test_smooth_errors_have_length():
    """Smooth errors are listed with their length beside the stops' own sigmas."""
    solution = solve(BARE.cell, BARE.recording, Settings(robot_noise="estimated"))
    common = {"smooth": {"eye": np.array([1e-4, 2e-4])}}
    alike = replace(solution, noise=replace(solution.noise, common=common))
    of = noise_summary(BARE.cell, BARE.recording, alike)["robots"]
    assert of["eye"]["smooth"]["length_m"] == 0.7
    assert "shift_m" not in of["eye"]["smooth"]
    np.testing.assert_allclose(of["eye"]["smooth"]["sigma"], [1e-4] * 3 + [2e-4] * 3, rtol=0.05)
    assert "smooth" not in of["hand"]


@pytest.mark.journey
def test_joint_errors_state_effect_after_base_and_mount():
    """Joint offsets of a milliradian are listed with their effect after base and mount absorb most of it.

    Each rotates a flange by more.
    """
    arms = simulate(Scenario(samples=14, joints=True, state_robot_noise=False, state_pixel_noise=False), 1)
    solution = solve(arms.cell, arms.recording, Settings(robot_noise="estimated"))
    zeros = {"joint_offsets": {"eye": np.array([5e-4, 1e-3])}}
    found = noise_summary(arms.cell, arms.recording, replace(solution, noise=replace(solution.noise, common=zeros)))[
        "robots"
    ]["eye"]["joint_offsets"]
    assert 1e-4 < np.mean(found["sigma"][3:]) < 1e-3
    assert (found["shift_m"], found["turn_rad"]) == (5e-4, 1e-3)


@pytest.mark.journey
def test_noise_survives_file_and_report():
    """Noise is in `calibrate`, in `calibration.json` and in the report's sentences."""
    found = calibrate(BARE.cell, with_detector_sigma(BARE.recording, 0.05))
    smooth = {"sigma": [1e-4] * 3 + [2e-4] * 3, "length_m": 0.7}
    robots = {**found.noise["robots"], "eye": {**found.noise["robots"]["eye"], "smooth": smooth}}
    found = replace(found, noise={**found.noise, "robots": robots})
    again = calibration_from_dict(calibration_to_dict(found))
    assert again.noise == found.noise
    text = "\n".join(noise_sentences(again))
    assert "times the sigma stated by its detector" in text
    assert "error of robot eye that is smooth over 0.7 m: 0.10 mm, 0.20 mrad" in text


@pytest.mark.journey
def test_few_samples_leave_sigmas_uncertain():
    """The rms factor over likely sigmas is little above 1 for 30 samples, and larger for four."""
    factors = []
    for count in (30, 4):
        made = simulate(Scenario(samples=count, robot_noise=(1e-4, 2e-4), state_robot_noise=False), 2)
        solution = solve(made.cell, made.recording, Settings(robot_noise="estimated"))
        factors.append(noise_summary(made.cell, made.recording, solution)["robots"]["eye"]["rms_factor"])
    assert 1 < factors[0] < 1.3
    assert factors[1] > 1.5


def test_all_estimated_noise_is_listed():
    """Robots are listed with freedoms (equations less unknowns) and rms factor, also clocks, shapes and images."""
    solution = solve(STATED.cell, STATED.recording)
    sigma = np.array([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3])
    noise = replace(
        solution.noise,
        robots={"hand": sigma},
        robot_variances={"hand": 4 * sigma**2},
        shapes={"board": (np.array([0.1, -0.2]), np.eye(2))},
    )
    timed = replace(solution, noise=noise, problem=replace(solution.problem, jitter_s={"wrist": 2e-3}))
    cell = replace(STATED.cell, correlated_px=0.4)
    found = noise_summary(cell, STATED.recording, timed)
    assert found == {
        "pixel_px": STATED.cell.pixel_px,
        "correlated_px": 0.4,
        "robots": {
            "eye": {"sigma_t_m": [2e-4] * 3, "sigma_r_rad": [4e-4] * 3},
            "hand": {
                "sigma_t_m": [1e-3, 2e-3, 3e-3],
                "sigma_r_rad": [4e-3, 5e-3, 6e-3],
                "freedoms": 12 * 6 - 18.0,
                "rms_factor": pytest.approx(2.0),
            },
        },
        "clocks": {"wrist": {"jitter_s": 2e-3}},
        "targets": {"board": {"shape": [0.1, -0.2]}},
    }
    few = replace(timed, problem=timed.problem.with_groups(g.take(np.arange(2)) for g in timed.problem.groups))
    assert noise_summary(cell, STATED.recording, few)["robots"]["hand"]["freedoms"] == 1.0


def make_sample(camera, sigmas, is_detected=True):
    """Pixels of a camera whose detector states these sigmas."""
    (sample,) = simulate(Scenario(samples=1), 0).recording.samples
    (seen,) = sample.observations
    claimed = None if sigmas is None else np.resize(np.array(sigmas), len(seen.ids))
    seen = replace(seen, camera=camera, detected=is_detected, sigma_px=claimed)
    return replace(sample, observations=(seen,))


class Views(SimpleNamespace):
    """A group of views."""

    def __len__(self):
        return self.count


def test_camera_noise_covers_its_measurements():
    """The noise of a camera covers views of all its targets, and lists estimated sigmas of its own measurements."""
    counts = {"a": {"pixel_px": 4, "stated": 0}, "b": {"pixel_px": 2}, "c": {"pose_m": 6, "pose_rad": 6}, "d": {}}
    groups = [
        Views(camera=name, count=count, measurement=SimpleNamespace(counts=lambda name=name: counts[name]))
        for name, count in (("a", 3), ("b", 2), ("a", 4), ("c", 9), ("d", 1))
    ]
    noise = SimpleNamespace(
        noise=Noise(pixel_px=0.3, pose_m=2e-3), cameras={"b": Noise(pixel_px=0.6)}, estimated=("pixel_px", "pose_m")
    )
    solution = SimpleNamespace(noise=noise, problem=SimpleNamespace(groups=groups))
    claims = [
        make_sample("a", [0.05, 0.15]),
        make_sample("a", [0.1]),
        make_sample("b", None),
        make_sample("b", [0.1], False),
    ]
    found = _camera_noise(Recording((*claims, make_sample("c", [0.1]))), solution)
    assert found == {
        "a": {"views_count": 7, "pixel_px": 0.3, "factor": pytest.approx(3.0)},
        "b": {"views_count": 2, "pixel_px": 0.6, "factor": None},
        "c": {"views_count": 9, "pose_m": 2e-3, "factor": None},
    }


def test_estimated_pixel_sigma_replaces_stated_one():
    """The estimated pixel sigma replaces that of the cell."""
    solution = solve(STATED.cell, STATED.recording)
    noise = replace(solution.noise, estimated=("pixel_px",), noise=solution.noise.noise._replace(pixel_px=0.77))
    found = noise_summary(STATED.cell, STATED.recording, replace(solution, noise=noise))
    assert found["pixel_px"] == 0.77
    assert "cameras" in found
    assert "correlated_px" not in found
