"""Poses of bases that agree best with all relations of pairs: a graph whose loops close."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.geometry import SE3, Array
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.numerics.sparse_hessian import SparseHessian

_GAUSS_NEWTON_ROUNDS = 10  # of Gauss-Newton; relations that nearly agree need three; assumed
_CONVERGED_STEP = 1e-6  # [m, rad] of a step: a descent goes on from there; assumed
_DAMPING = np.array([1e-9])  # as the first of a descent: rounding of what no relation holds


@dataclass(frozen=True, eq=False)
class Relation:
    """Relation of two bases by a pair: `eye_base_from_hand_base`, by their names, None of the reference."""

    eye_base: str | None
    hand_base: str | None
    eye_base_from_hand_base: SE3


def placed_by_all(bases: Mapping[str, SE3], relations: Sequence[Relation]) -> dict[str, SE3]:
    """Bases (`world_from_base`, by name) where relations, all equal in weight, agree with them best.

    Args:
        bases: Where they are about; one that no relation names stays.
        relations: Between them and the reference.
    """
    named = {name for of in relations for name in (of.eye_base, of.hand_base) if name is not None}
    column = {name: 6 * k for k, name in enumerate(name for name in bases if name in named)}
    placed, world = dict(bases), SE3.identity()
    told = SE3.stack([of.eye_base_from_hand_base for of in relations])
    for _ in range(_GAUSS_NEWTON_ROUNDS):
        world_from_eye = SE3.stack([world if of.eye_base is None else placed[of.eye_base] for of in relations])
        world_from_hand = SE3.stack([world if of.hand_base is None else placed[of.hand_base] for of in relations])
        residual = (told.inverse() @ world_from_eye.inverse() @ world_from_hand).log()
        to_hand = right_jacobian_inverse(residual)
        to_eye = -to_hand @ (world_from_hand.inverse() @ world_from_eye).adjoint()
        sides = [(column.get(of.eye_base or ""), column.get(of.hand_base or "")) for of in relations]
        jacobian = _jacobian(sides, to_eye, to_hand, 6 * len(column))
        hessian = SparseHessian(scipy.sparse.csc_array(jacobian.T @ jacobian))
        step = hessian.damped_step((jacobian.T @ residual.ravel())[None], _DAMPING)[0]
        for name, at in column.items():
            placed[name] = placed[name] @ SE3.exp(step[at : at + 6])
        if np.abs(step).max(initial=0.0) < _CONVERGED_STEP:
            break
    return placed


def _jacobian(
    sides: Sequence[tuple[int | None, int | None]], eye_jacobian: Array, hand_jacobian: Array, width: int
) -> scipy.sparse.csc_array:
    """Derivative of all residuals to the bases' steps."""
    blocks = [
        (k, at, to[k])
        for k, ats in enumerate(sides)
        for at, to in zip(ats, (eye_jacobian, hand_jacobian), strict=True)
        if at is not None
    ]
    row = np.array([6 * k for k, _, _ in blocks])[:, None, None] + np.arange(6)[:, None]
    column = np.array([at for _, at, _ in blocks])[:, None, None] + np.arange(6)
    values = np.stack([block for _, _, block in blocks])
    row, column = (np.broadcast_to(each, values.shape).ravel() for each in (row, column))
    return scipy.sparse.csc_array(
        scipy.sparse.coo_array((values.ravel(), (row, column)), shape=(6 * len(sides), width))
    )
