"""Lower bound of the cost of a loop's rotations, as a quadratic form on products of unit quaternions.

For A X B = Y C Z the quaternion of Z' C' Y' A X B is linear in those of X, Y' and Z'. sin^2(angle / 2) of a loop is
therefore a quadratic form on their product, for any signs of the quaternions. w_i sin^2(angle_i / 2) is a lower bound
of the cost of each view. The sum over views is one form, whose size does not depend on the number of views.
Source: docs/mathematics.md (10.2), (10.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.estimation.certificate.relaxation import Factors
from basecal.estimation.certificate.view_rotation import ViewCosts
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.closed_form import Loop, Rotations
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import quaternion_from_rotation, rotation_from_quaternion

_CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])
_CHUNK_VIEWS = 2048


class LoopForm(NamedTuple):
    """Quadratic form of the rotations of one camera and target.

    Attributes:
        loop: Recorded and known rotations of the loop, with the weights of the views.
        form: (4^k, 4^k) form of the k unknown factors, per unit of weight: between 0 and 1 on unit quaternions.
        weight: Sum of the views' weights.
        merged: "x" if X represents Y' X, "z" if Z represents Y Z, because there is no arm between them; else "".
    """

    loop: Loop
    form: Array
    weight: float
    merged: str


def _product_tensor() -> Array:
    """Tensor T, (4, 4, 4), with (p q)_k = sum of T[k, i, j] p_i q_j for quaternions (x, y, z, w)."""
    tensor = np.zeros((4, 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        tensor[i, j, k], tensor[i, k, j] = 1, -1
        tensor[i, i, 3] = tensor[i, 3, i] = 1
        tensor[3, i, i] = -1
    tensor[3, 3, 3] = 1
    return tensor


_PRODUCT = _product_tensor()


def loop_form(problem: Problem, state: State, group: ViewGroup, views: ViewCosts) -> LoopForm:
    """Make the quadratic form of one group of views.

    Args:
        problem: Problem, with the fixed transforms and the robots' noise.
        state: State, with the values of the fixed transforms.
        group: The views.
        views: Lower bounds of the cost of their rotations.
    """
    loop, merged = _loop(problem, state, group, views)
    # Weights of whole loops: the loop's angle is at most the sum of the view's angle and those of its robots' errors.
    # The weights follow from sin(a + b) <= sin(a) + sin(b) and Cauchy's inequality. A stop's error affects all of its
    # views.
    with np.errstate(divide="ignore"):
        slack = 1 / views.weight
    weight = 1 / (slack + sum(_robot_slack(problem, end.stop) for end in group.ends))
    loop = loop._replace(weight=weight)
    total = float(weight.sum())
    size = 4 ** len(loop.unknown)
    form = np.zeros((size, size))
    for first in range(0, len(weight), _CHUNK_VIEWS):
        chunk = slice(first, first + _CHUNK_VIEWS)
        rows = _rows(loop, chunk) * np.sqrt(weight[chunk, None, None])
        flat = rows.reshape(-1, size)
        form += flat.T @ flat
    return LoopForm(loop, form / max(total, 1e-300), total, merged)


def rotation_factors(loop: Loop, rotations: Rotations) -> Factors:
    """Unit quaternions of the unknown rotations: of X, and of the inverses of Y and Z."""
    factors = {"x": quaternion_from_rotation(rotations.x), "y": _inverse(rotations.y), "z": _inverse(rotations.z)}
    return tuple(factors[name] for name in loop.unknown)


def rotations_from_factors(loop: Loop, factors: Factors) -> Rotations:
    """Rotations X, Y and Z from the factors of unknown rotations and the known rotations."""
    factor_of = dict(zip(loop.unknown, factors, strict=True))

    def rotation(name: str) -> Array:
        """Known rotation, or rotation of its factor, (3, 3)."""
        known: SE3 | None = getattr(loop, name)
        if known is not None:
            return known.rotation
        return rotation_from_quaternion(factor_of[name] if name == "x" else _CONJUGATE * factor_of[name])

    return Rotations(rotation("x"), rotation("y"), rotation("z"))


def state_rotations(state: State, group: ViewGroup, merged_factor: str) -> Rotations:
    """Rotations of X, Y and Z of a state, merged as in a `LoopForm` with `merged_factor` as its `merged`."""
    x, z = state.transforms[group.eye.mount].rotation, state.transforms[group.hand.mount].rotation
    y = group.eye_base_from_hand_base(state.transforms).rotation
    if merged_factor == "x":
        return Rotations(y.T @ x, np.eye(3), z)
    return Rotations(x, np.eye(3), y @ z) if merged_factor == "z" else Rotations(x, y, z)


def _inverse(rotation: Array) -> Array:
    return quaternion_from_rotation(rotation.mT)


def _loop(problem: Problem, state: State, group: ViewGroup, views: ViewCosts) -> tuple[Loop, str]:
    fixed = {n for n, unknown in problem.unknowns.items() if unknown.status == "fixed"}
    x, z = (state.transforms[end.mount] if end.mount in fixed else None for end in group.ends)
    is_base_fixed = all(end.base is None or end.base in fixed for end in group.ends)
    y = group.eye_base_from_hand_base(state.transforms) if is_base_fixed else None
    merged = ""
    if y is None and group.eye.robot is None:
        x, y, merged = None, SE3.identity(), "x"
    elif y is None and group.hand.robot is None:
        z, y, merged = None, SE3.identity(), "z"
    b = views.camera_from_target
    return Loop(group.eye.base_from_flange, b, group.hand.base_from_flange, x, y, z, views.weight), merged


def _robot_slack(problem: Problem, stop: IntArray) -> Array:
    if not len(problem.stops):
        return np.zeros(len(stop))
    sigma = problem.stops.sigma[:, 3:].max(1)
    stops = [end.stop for group in problem.groups for end in group.ends]
    shared = sum(np.bincount(s[s >= 0], minlength=len(sigma)) for s in stops)
    slack: Array = np.where(stop >= 0, (shared * sigma**2)[stop] / 4, 0.0)
    return slack


def _rows(loop: Loop, views: slice) -> Array:
    """Coefficients of the vector part of the loop's quaternion in the unknown factors, (n, 3, 4^k)."""
    a, b = (quaternion_from_rotation(t.rotation[views]) for t in (loop.a, loop.b))
    c = _inverse(loop.c.rotation[views])
    around_x = np.einsum("krj,nr,jis,ns->nki", _PRODUCT, a, _PRODUCT, b, optimize=True)
    behind_y = np.einsum("mrl,nr,lyk->nmyk", _PRODUCT, c, _PRODUCT, optimize=True)
    tensor = np.einsum("rzm,nmyk,nkx->nrxyz", _PRODUCT[:3], behind_y, around_x, optimize=True)
    x = _columns(loop.x, False)
    y, z = _columns(loop.y, True), _columns(loop.z, True)
    rows: Array = np.einsum("nrxyz,xi,yj,zk->nrijk", tensor, x, y, z, optimize=True)
    return rows.reshape(*rows.shape[:2], -1)


def _columns(rotation: SE3 | None, is_inverse: bool) -> Array:
    """Columns of a factor: the identity (4, 4) if it is unknown, else its value (4, 1)."""
    if rotation is None:
        return np.eye(4)
    return (_inverse(rotation.rotation) if is_inverse else quaternion_from_rotation(rotation.rotation))[:, None]
