"""Likelihoods of wider hypotheses where arms have noise."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.input_check.hypothesis_fit import fit_hypothesis
from basecal.accuracy.input_check.noise_evidence import _scatter_gain, noise_evidence
from basecal.accuracy.input_check.rewriting import with_pixels
from basecal.accuracy.input_check.target_sizes import target_size
from basecal.estimation.settings import Settings
from basecal.simulation import Scenario, simulate
from quick import quick

FEW = Scenario(samples=8, robot_noise=(1e-4, 2e-4), state_robot_noise=False, state_pixel_noise=False, pixel_px=0.02)
STATED = Settings(robot_noise="stated")


def with_lens(cell, shift_px=0.0, status="fixed"):
    """The cell with the principal point stated off by so much."""
    camera = cell.cameras["wrist"]
    parameters = camera.intrinsics.camera.parameters.copy()
    parameters[2] += shift_px
    lens = camera.intrinsics.camera.with_parameters(parameters)
    changed = replace(camera, intrinsics=replace(camera.intrinsics, camera=lens, status=status))
    return replace(cell, cameras={"wrist": changed})


def of_size(made, factor):
    """Evidence for a board so many times as large as stated."""
    sized = target_size("board", factor, made.cell).apply(made.cell, made.recording)
    declared = fit_hypothesis(made.cell, made.recording, STATED)
    return noise_evidence(fit_hypothesis(*sized, STATED), declared)


def of_lens(made, cell):
    """Evidence for a lens that is not as the cell states."""
    declared = fit_hypothesis(cell, made.recording, STATED)
    return noise_evidence(fit_hypothesis(with_lens(cell, status="free"), made.recording, STATED), declared)


@pytest.mark.parametrize("seed", quick(range(3), [0]))
def test_noise_of_arms_is_no_size(seed):
    """By 0.3 % a board may seem larger where arms are off by 0.1 mm: likelihoods do not ask for it; for 3 % they do."""
    made = simulate(FEW, seed)
    assert of_size(made, 1.003).chance > 1e-3
    true = target_size("board", 1.03, made.cell).apply(made.cell, made.recording)[0]
    wrong = of_size(replace(made, cell=true), 1 / 1.03)
    assert wrong.chance < 1e-6
    assert wrong.gain > 30


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_pixels_of_any_size_scatter_alike(seed):
    """Pixels bent as no lens bends them say nothing for or against a size of 2 % where arms are off by millimetres."""
    made = simulate(replace(FEW, samples=12, robot_noise=(3e-3, 5e-3), intrinsics="free", pixel_px=0.1), seed)
    bent = with_pixels(made.recording, lambda uv: uv + 6.0 * np.sin(uv[:, ::-1] / (90.0, 70.0)))
    assert abs(of_size(replace(made, recording=bent), 1.02).gain) < 2.0


def test_points_in_space_show_their_size():
    """Distances between points that are measured in space tell a size of 5 % whatever arms do."""
    made = simulate(replace(FEW, target="points3d"), 0)
    wrong = target_size("board", 1.05, made.cell).apply(made.cell, made.recording)[0]
    found = of_size(replace(made, cell=wrong), 1 / 1.05)
    assert found.gain > 100
    assert found.chance < 1e-12


@pytest.mark.parametrize("seed", quick(range(3), [1]))
def test_noise_of_arms_is_no_lens(seed):
    """A lens as stated has chance; one whose centre is stated 30 px off has none."""
    made = simulate(FEW, seed)
    assert of_lens(made, made.cell).chance > 1e-3
    assert of_lens(made, with_lens(made.cell, 30.0)).chance < 1e-6


def test_hypotheses_of_other_views_are_not_compared():
    """Fits that rest on different views have likelihoods of different data."""
    made = simulate(FEW, 0)
    fewer = replace(made.recording, samples=made.recording.samples[:-1])
    whole, part = (fit_hypothesis(made.cell, of, STATED) for of in (made.recording, fewer))
    assert noise_evidence(part, whole) is None


@pytest.mark.parametrize("stated", [True, False])
def test_points_in_space_speak_for_the_size_about_which_they_scatter_less(stated):
    """The true size gains over one a hundredth off what that loses over it, and nothing over itself."""
    made = simulate(Scenario(samples=6, target="points3d", state_pixel_noise=stated), 0)
    if not stated:
        unstated = [replace(o, sigma_m=None) for s in made.recording.samples for o in s.observations]
        samples = [replace(s, observations=(o,)) for s, o in zip(made.recording.samples, unstated, strict=True)]
        made = replace(made, recording=replace(made.recording, samples=tuple(samples)))
    wrong = target_size("board", 1.01, made.cell).apply(made.cell, made.recording)[0]
    right, off = (fit_hypothesis(cell, made.recording, STATED).solution for cell in (made.cell, wrong))
    assert _scatter_gain(right, right) == 0.0
    assert _scatter_gain(right, off) > 10
    assert _scatter_gain(off, right) == pytest.approx(-_scatter_gain(right, off))
