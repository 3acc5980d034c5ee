"""Tests of the secant estimate of residual curvature on quadratics with known curvature."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.structured_secant import usable_curvature, with_secant

HESSIAN = np.diag([4.0, 1.0, 9.0])
STEP = np.array([0.3, -0.2, 0.1])
YES = np.array([True])


def learn_curvature(missing, bend=None, step=STEP, near=YES):
    """The curvature learnt from a step of a quadratic whose Hessian lacks a part."""
    bend = np.zeros((3, 3)) if bend is None else bend
    change = (HESSIAN + missing) @ step
    return with_secant(bend[None], HESSIAN[None], change[None], step[None], near)[0]


@pytest.mark.parametrize("share", [0.9, -0.6])
def test_curvature_of_rank_one_is_learnt_in_one_step(share):
    """Curvature of rank one, above or below the Hessian's, is found fully by a step that is not orthogonal to it."""
    direction = np.array([2.0, 0.5, 0.0])
    missing = share * np.outer(direction, direction) / 4.25
    np.testing.assert_allclose(learn_curvature(missing), missing, atol=1e-12)


def test_curvature_of_rank_two_needs_two_steps():
    """The second step keeps the first step's estimate, and the predicted change of the gradient is exact."""
    missing = np.diag([2.0, 0.5, 0.0])
    first = learn_curvature(missing)
    second = learn_curvature(missing, first, np.array([0.1, 0.4, 0.2]))
    np.testing.assert_allclose(second, missing, atol=1e-12)
    assert np.abs(first - missing).max() > 0.1


def test_curvature_is_discarded_far_from_the_optimum():
    """Far from an optimum, neither the last step nor the earlier estimate gives any curvature."""
    assert not learn_curvature(np.eye(3), np.eye(3), near=~YES).any()


def test_linear_model_has_no_residual_curvature():
    """Changes below a hundredth of the curvature, and steps of zero, leave the estimate unchanged."""
    assert not learn_curvature(0.005 * HESSIAN).any()
    assert not learn_curvature(np.eye(3), step=np.zeros(3)).any()


def test_ill_conditioned_secant_update_is_skipped():
    """An update is skipped if it would be divided by a small part along the step.

    A deviation orthogonal to the step would give a curvature larger than the Hessian.
    """
    change = HESSIAN @ STEP + np.array([0.2, 0.3, -0.01])
    found = with_secant(np.zeros((1, 3, 3)), HESSIAN[None], change[None], STEP[None], YES)
    assert not found.any()


def test_problems_of_a_batch_are_independent():
    """One problem with curvature is found beside one without and one far from its optimum."""
    missing = np.stack([np.diag([2.0, 0, 0]), np.zeros((3, 3)), np.eye(3)])
    change = (HESSIAN + missing) @ STEP
    hessians, steps = np.tile(HESSIAN, (3, 1, 1)), np.tile(STEP, (3, 1))
    found = with_secant(np.zeros((3, 3, 3)), hessians, change, steps, np.array([True, True, False]))
    np.testing.assert_allclose(found[0], missing[0], atol=1e-12)
    assert not found[1:].any()


def test_excessive_negative_curvature_is_not_used():
    """Curvature may take away at most nine tenths of a diagonal entry. An unobservable unknown is no exception."""
    hessian = np.diag([4.0, 1.0, 0.0])
    bends = np.stack([np.diag([-3.5, 0.3, 0.0]), np.diag([-3.7, 0.3, 0.0]), np.diag([-9.0, 0.0, 0.0])])
    found = usable_curvature(bends, np.tile(hessian, (3, 1, 1)))
    np.testing.assert_array_equal(found, np.stack([bends[0], np.zeros((3, 3)), np.zeros((3, 3))]))


@pytest.mark.parametrize(("across", "has_curvature"), [(49.0, True), (51.0, False), (-49.0, True), (-51.0, False)])
def test_orthogonal_gradient_change_gives_no_curvature(across, has_curvature):
    """At least a hundredth of the change has to be along the step.

    Here 0.5 of the first gradient is compared with some fifty of the second.
    """
    step = np.array([0.3, 0.0, 0.0])
    change = HESSIAN @ step + np.array([1.0, across, 0.0])
    found = with_secant(np.zeros((1, 3, 3)), HESSIAN[None], change[None], step[None], YES)
    assert found.any() == has_curvature
