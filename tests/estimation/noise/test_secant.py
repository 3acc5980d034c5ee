"""A curvature that is off is put right by the slopes seen, and stays regular."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.noise.secant import Secant, correct_curvature


def _steps(curvature: np.ndarray, seed: int, count: int) -> list[Secant]:
    steps = np.random.default_rng(seed).standard_normal((count, len(curvature)))
    return [Secant(step, curvature @ step) for step in steps]


def test_as_many_steps_as_sigmas_tell_the_curvature() -> None:
    """Of a quadratic, k steps in general position make any curvature that is too small the right one."""
    root = np.random.default_rng(1).standard_normal((4, 4))
    right = root @ root.T + np.eye(4)
    found = correct_curvature(0.05 * np.eye(4), _steps(right, 2, 4))
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-9)


def test_a_step_along_the_slope_is_taken_as_it_was() -> None:
    """The change of slope over the last step follows from the curvature, larger or smaller than it was."""
    for factor in (0.5, 2.0):
        right, guess = np.diag([1.0, 4.0, 9.0]), factor * np.diag([1.0, 4.0, 9.0])
        (secant,) = _steps(right, 3, 1)
        np.testing.assert_allclose(correct_curvature(guess, [secant]) @ secant.step, secant.change, rtol=1e-12)


def test_what_would_not_be_regular_is_left_out() -> None:
    """A slope that falls along a step, and a change at right angles to it, leave the curvature as it is."""
    unit = np.eye(2)
    for change in (np.array([-1.0, 0.0]), np.array([1.0, 3.0])):
        np.testing.assert_array_equal(correct_curvature(unit, [Secant(np.array([1.0, 0.0]), change)]), unit)


@pytest.mark.parametrize(("cosine", "counts"), [(1.1e-8, True), (0.9e-8, False)])
def test_a_change_nearly_at_right_angles_says_nothing_of_the_step(cosine: float, counts: bool) -> None:
    """However long the step and the change are."""
    for length in (1e-3, 1.0, 1e3):
        for size in (1e-3, 5.0):
            off, step = size * np.array([cosine, 1.0]), np.array([length, 0.0])
            curvature = np.diag([0.0, 1e12])
            found = correct_curvature(curvature, [Secant(step, off)])
            assert np.array_equal(found, curvature) != counts


@pytest.mark.parametrize("left", [0.19, 0.21])
def test_a_fifth_of_the_curvature_along_a_correction_is_left(left: float) -> None:
    """A correction that lowers it more is not made; one that leaves more is, along each axis."""
    curvature = np.diag([4.0, 2.0])
    for axis in range(2):
        step = np.eye(2)[axis]
        found = correct_curvature(curvature, [Secant(step, left * curvature @ step)])
        lowered = curvature - (1 - left) * curvature * np.outer(step, step)
        np.testing.assert_allclose(found, lowered if left > 0.2 else curvature, rtol=1e-12)


def test_pairs_are_taken_in_turn() -> None:
    """The second by the curvature that the first left, though the first was left out."""
    curvature = np.eye(2)
    bad, good = Secant(np.array([1.0, 0.0]), np.array([-1.0, 0.0])), Secant(np.array([0.0, 2.0]), np.array([0.0, 6.0]))
    np.testing.assert_allclose(correct_curvature(curvature, [bad, good]), np.diag([1.0, 3.0]))
    again = Secant(np.array([0.0, 1.0]), np.array([0.0, 5.0]))
    np.testing.assert_allclose(correct_curvature(curvature, [good, again]), np.diag([1.0, 5.0]))
