"""Tests of a descent step for residuals with robust weights."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.robust_step import NORMAL_MAD, robust_step

RNG = np.random.default_rng(1)
ROWS, TRUE = RNG.standard_normal((40, 2, 3)), np.array([0.3, -0.2, 0.1])


def test_robust_steps_converge_despite_outliers():
    """Ten steps from zero reach the truth though 8 of 40 rows are off by 50."""
    wrong = np.where(np.arange(40) % 5 == 0, 50.0, 0.0)[:, None]
    at = np.zeros(3)
    for _ in range(10):
        at = at + robust_step(lambda step, at=at: ROWS @ (at + step - TRUE) + wrong, 3, 0.1)
    np.testing.assert_allclose(at, TRUE, atol=1e-3)


def test_prior_determines_unobservable_directions():
    """Without any gradient along the third axis, the step along it is that of the prior."""
    flat = ROWS * [1.0, 1.0, 0.0]
    step = robust_step(lambda step: flat @ (step - TRUE), 3, 1e6, np.diag([0.0, 0.0, 4.0]), np.array([0.0, 0.0, 2.0]))
    np.testing.assert_allclose(step, [*TRUE[:2], -0.5], atol=1e-6)


def test_rows_have_cauchy_weights():
    """A step solves the normal equations with weights 1 / (1 + r^2 / tail^2), r the norm of a row."""
    offset, tail = 3 * RNG.standard_normal((40, 2)), 0.7
    step = robust_step(lambda step: ROWS @ step + offset, 3, tail)
    weight = 1 / (1 + np.sum(offset**2, axis=1) / tail**2)
    information = np.einsum("n,nki,nkj->ij", weight, ROWS, ROWS)
    np.testing.assert_allclose(
        step, -np.linalg.solve(information, np.einsum("n,nki,nk->i", weight, ROWS, offset)), rtol=1e-6
    )


def test_normal_mad_estimates_sigma():
    """Ten thousand normal numbers have the sigma of their scaled median deviation within 2 %."""
    drawn = np.random.default_rng(0).normal(1.0, 3.0, 10_000)
    assert NORMAL_MAD * np.median(np.abs(drawn - np.median(drawn))) == pytest.approx(3.0, rel=0.02)
