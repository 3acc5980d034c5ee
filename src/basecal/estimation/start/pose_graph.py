"""Poses of robot bases from relative poses of pairs: a pose graph."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import numpy as np
import scipy  # submodules are loaded when they are first used

from basecal.geometry import SE3, Array
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.numerics.sparse_hessian import SparseHessian

_MAX_ITERATIONS = 10  # Gauss-Newton; relations with small errors need three
_CONVERGED_STEP = 1e-6  # [m, rad]: the bundle adjustment continues from here
_DAMPING = np.array([1e-9])  # relative: only makes the equations solvable for bases that no relation determines

Relations = Mapping[tuple[str | None, str | None], SE3]
"""`eye_base_from_hand_base` of pairs, by the names of both bases; None is the reference."""


def place_bases(bases: Mapping[str, SE3], relations: Relations) -> dict[str, SE3]:
    """Poses of bases in the world: the given ones, and all that are connected to them or to the reference."""
    neighbours: dict[str | None, list[tuple[str | None, SE3]]] = defaultdict(list)
    for (eye, hand), eye_base_from_hand_base in relations.items():
        neighbours[eye].append((hand, eye_base_from_hand_base))
        neighbours[hand].append((eye, eye_base_from_hand_base.inverse()))
    placed = dict[str | None, SE3]([(None, SE3.identity()), *bases.items()])
    queue = [*placed]
    for name in queue:  # grows
        for neighbour, base_from_neighbour in neighbours[name]:
            if neighbour not in placed:
                placed[neighbour] = placed[name] @ base_from_neighbour
                queue.append(neighbour)
    return {name: pose for name, pose in placed.items() if name is not None}


def adjust_bases(bases: Mapping[str, SE3], relations: Relations) -> dict[str, SE3]:
    """Poses of bases in the world that agree best with all relations, all weighted equally.

    Chains of relations accumulate errors with their length. Relations that close loops correct them.

    Args:
        bases: Approximate poses of all bases that relations name, except the reference.
        relations: Measured relative poses.
    """
    measured = SE3.stack([*relations.values()])
    index = {name: k for k, name in enumerate((None, *bases))}
    eye, hand = (np.array([index[pair[k]] for pair in relations]) for k in (0, 1))
    world_from_base = SE3.stack([SE3.identity(), *bases.values()])
    for _ in range(_MAX_ITERATIONS):
        world_from_eye_base, world_from_hand_base = world_from_base[eye], world_from_base[hand]
        eye_base_from_hand_base = world_from_eye_base.inverse() @ world_from_hand_base
        residual = (measured.inverse() @ eye_base_from_hand_base).log()
        by_hand = right_jacobian_inverse(residual)
        by_eye = -by_hand @ eye_base_from_hand_base.inverse().adjoint()
        step = _gauss_newton_step(residual, np.stack([by_eye, by_hand]), np.stack([eye, hand]), len(bases))
        world_from_base = world_from_base @ SE3.exp(step)
        if np.abs(step).max() < _CONVERGED_STEP:
            break
    return {name: world_from_base[k] for name, k in index.items() if name is not None}


def _gauss_newton_step(residual: Array, blocks: Array, nodes: Array, bases: int) -> Array:
    """Steps of the reference, which are zero, and of the bases, (1 + bases, 6).

    Args:
        residual: (r, 6).
        blocks: Derivatives of residuals to both nodes, (2, r, 6, 6).
        nodes: The two nodes of each relation, (2, r); 0 is the reference.
        bases: Number of bases.
    """
    row, column = np.broadcast_arrays(
        np.arange(residual.size).reshape(-1, 6, 1), 6 * nodes[..., None, None] + np.arange(6)
    )
    shape = (residual.size, 6 * (1 + bases))
    jacobian = scipy.sparse.coo_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=shape).tocsc()[:, 6:]
    hessian = SparseHessian(scipy.sparse.csc_array(jacobian.T @ jacobian))
    step = hessian.damped_step((jacobian.T @ residual.ravel())[None], _DAMPING)[0]
    return np.concatenate([np.zeros((1, 6)), step.reshape(-1, 6)])
