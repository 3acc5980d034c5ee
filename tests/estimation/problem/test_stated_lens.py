"""Tests of stated lenses as priors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Intrinsics
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.stated_lens import likely_sigmas, usual_sigmas, with_usual_error
from basecal.geometry import Camera
from basecal.simulation import Scenario, simulate

LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0, -0.1, 0.05, 0.0, 0.0, 0.0]), (1280, 720))
MODELS = [LENS, Camera("pinhole", LENS.parameters[:4], None), Camera("fisheye", LENS.parameters[:8], (1280, 720))]


@pytest.mark.parametrize("camera", MODELS)
def test_distortion_sigmas_move_the_corner_equally(camera):
    """One sigma of each moves the farthest corner by a thousandth of the width, which is twice cx if not stated."""
    sigma = usual_sigmas(camera)
    np.testing.assert_allclose(sigma[:4], [1.8, 1.82, 1.28, 1.28])
    plain = camera.with_parameters(np.append(camera.parameters[:4], np.zeros(len(camera.distortion))))
    corner = np.array([640 / 900, 360 / 910, 1.0])
    for k, term in enumerate(sigma[4:], start=4):
        bent = plain.with_parameters(plain.parameters + 1e-3 * term * np.eye(len(sigma))[k])
        assert np.linalg.norm(bent.project(corner) - plain.project(corner)) == pytest.approx(1.28e-3, rel=0.01)


@pytest.mark.parametrize("lens", [
    Intrinsics("fixed", LENS, exact=True), Intrinsics("free", LENS), Intrinsics("prior", LENS, np.ones(9)),
])  # fmt: skip
def test_other_lenses_are_unchanged(lens):
    """Exact lenses, free lenses, and priors with their own sigmas are unchanged."""
    assert with_usual_error(lens) is lens


def test_stated_lens_has_columns():
    """A stated lens has columns unless it is exact, as simulated cells state theirs."""
    made = simulate(Scenario(samples=4), 0)
    wrist = made.cell.cameras["wrist"]
    cell = replace(made.cell, cameras={"wrist": replace(wrist, intrinsics=replace(wrist.intrinsics, exact=False))})
    assert "wrist" not in build_problem(made.cell, made.recording)[0].columns
    problem, _ = build_problem(cell, made.recording)
    assert problem.columns["wrist"].stop - problem.columns["wrist"].start == len(wrist.intrinsics.camera.parameters)
    assert problem.lenses["wrist"].status == "prior"


def test_likely_sigmas_follow_the_data():
    """Errors are the usual ones if the lens agrees with the statement, known or not.

    They are larger if it is far off, block by block.
    """
    usual = usual_sigmas(LENS)
    lens = Intrinsics("prior", LENS, usual)
    for share in (0.0, 1.0):
        np.testing.assert_allclose(likely_sigmas(lens, LENS, share * np.diag(usual**2)), usual)
    moved = LENS.with_parameters(LENS.parameters + 10 * usual * (np.arange(9) == 2))
    expected = np.where(np.isin(np.arange(9), (2, 3)), np.sqrt(20.6), 1.0)
    np.testing.assert_allclose(likely_sigmas(lens, moved, np.zeros((9, 9))) / usual, expected)


@pytest.mark.parametrize("sigma", [0.3, 2.0])
def test_likely_sigmas_are_a_fixed_point(sigma):
    """The expected squares, estimated again with them as prior, are unchanged, for data of one sigma in usual units."""
    usual = usual_sigmas(LENS)
    shift = np.where(np.arange(9) < 4, 20.0, 0.0)
    used = 9.0
    posterior = 1 / (1 / used + 1 / sigma**2)
    moved = LENS.with_parameters(LENS.parameters + usual * shift * posterior / sigma**2)
    lens = Intrinsics("prior", LENS, np.sqrt(used) * usual)
    variance = (likely_sigmas(lens, moved, posterior * np.diag(usual**2)) / usual) ** 2
    again = 1 / (1 / variance + 1 / sigma**2)
    squares = (shift * again / sigma**2) ** 2 + again
    np.testing.assert_allclose(variance[:4], (3 + 2 * squares[:4]) / 5, rtol=0.02)
    np.testing.assert_allclose(variance[4:], 1.0 if sigma < 1 else variance[4], rtol=0.02)
