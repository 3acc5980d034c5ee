"""What residuals bend, learnt of quadratics whose curvature is known."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.structured_secant import usable_curvature, with_secant

HESSIAN = np.diag([4.0, 1.0, 9.0])
STEP = np.array([0.3, -0.2, 0.1])
YES = np.array([True])


def learnt(missing, bend=None, step=STEP, near=YES):
    """What a step of a quadratic shows, of whose curvature the hessian lacks a part."""
    bend = np.zeros((3, 3)) if bend is None else bend
    change = (HESSIAN + missing) @ step
    return with_secant(bend[None], HESSIAN[None], change[None], step[None], near)[0]


@pytest.mark.parametrize("share", [0.9, -0.6])
def test_curvature_of_one_direction_is_learnt_whole(share):
    """Of rank one, more or less than the hessian says: a step not across it shows all of it."""
    direction = np.array([2.0, 0.5, 0.0])
    missing = share * np.outer(direction, direction) / 4.25
    np.testing.assert_allclose(learnt(missing), missing, atol=1e-12)


def test_steps_add_up():
    """Of rank two, by two steps: the second keeps what the first showed, and the gradient changes as is said."""
    missing = np.diag([2.0, 0.5, 0.0])
    first = learnt(missing)
    second = learnt(missing, first, np.array([0.1, 0.4, 0.2]))
    np.testing.assert_allclose(second, missing, atol=1e-12)
    assert np.abs(first - missing).max() > 0.1


def test_far_from_an_optimum_nothing_is_known():
    """Neither what a step shows nor what was known before."""
    assert not learnt(np.eye(3), np.eye(3), near=~YES).any()


def test_a_straight_model_bends_nothing():
    """Less than a hundredth of the curvature, and steps that are none, leave it as it was."""
    assert not learnt(0.005 * HESSIAN).any()
    assert not learnt(np.eye(3), step=np.zeros(3)).any()


def test_what_would_be_divided_by_next_to_nothing_is_left():
    """A miss across the step, whose part along it is small, would make a bend larger than the hessian."""
    change = HESSIAN @ STEP + np.array([0.2, 0.3, -0.01])
    found = with_secant(np.zeros((1, 3, 3)), HESSIAN[None], change[None], STEP[None], YES)
    assert not found.any()


def test_each_problem_of_a_batch_is_its_own():
    """One that bends beside one that does not and one that is far from its optimum."""
    missing = np.stack([np.diag([2.0, 0, 0]), np.zeros((3, 3)), np.eye(3)])
    change = (HESSIAN + missing) @ STEP
    hessians, steps = np.tile(HESSIAN, (3, 1, 1)), np.tile(STEP, (3, 1))
    found = with_secant(np.zeros((3, 3, 3)), hessians, change, steps, np.array([True, True, False]))
    np.testing.assert_allclose(found[0], missing[0], atol=1e-12)
    assert not found[1:].any()


def test_a_bend_that_leaves_nothing_of_the_hessian_is_not_used():
    """Nine tenths of a diagonal taken away is as much as may be; an unknown that nothing holds is no reason."""
    hessian = np.diag([4.0, 1.0, 0.0])
    bends = np.stack([np.diag([-3.5, 0.3, 0.0]), np.diag([-3.7, 0.3, 0.0]), np.diag([-9.0, 0.0, 0.0])])
    found = usable_curvature(bends, np.tile(hessian, (3, 1, 1)))
    np.testing.assert_array_equal(found, np.stack([bends[0], np.zeros((3, 3)), np.zeros((3, 3))]))


@pytest.mark.parametrize(("across", "told"), [(49.0, True), (51.0, False), (-49.0, True), (-51.0, False)])
def test_a_change_across_the_step_is_no_curvature_along_it(across, told):
    """A hundredth of its length along the step suffices: 0.5 of the first gradient beside some fifty of the second."""
    step = np.array([0.3, 0.0, 0.0])
    change = HESSIAN @ step + np.array([1.0, across, 0.0])
    found = with_secant(np.zeros((1, 3, 3)), HESSIAN[None], change[None], step[None], YES)
    assert found.any() == told
