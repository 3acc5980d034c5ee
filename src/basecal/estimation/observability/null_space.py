"""Separate unobservable directions into translations and rotations of frames.

The input is a basis of the null space, in which translations and rotations of several unknowns are mixed arbitrarily.
Directions of lenses and robot kinematics are separated first, then pure translations, then uncorrelated groups of
transforms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import principal_axes, sort_by_share

# Singular values and norms of an orthonormal basis, relative to a unit direction.
_LITTLE_SHARE = 0.2  # a basis with a smaller part in an unknown does not move it; assumed
_LEAST_CORRELATION = 0.05  # unknowns with less correlated parts move independently; assumed
_MAIN_SHARE = 0.5  # the first unknown with at least this share of the largest motion is the main one; assumed
_COUPLED_SHARE = 0.3  # unknowns with at least this share of the main one's motion are coupled with it; assumed

Kind = Literal["translation", "rotation", "lens", "robot parameters"]


@dataclass(frozen=True, eq=False)
class NullDirection:
    """Unobservable direction, or several of the same kind.

    Attributes:
        kind: Kind of the main unknown's motion.
        names: Names of the unknowns that move, the main unknown first.
        twists_in_parent: (k, 6) [m, rad] motion of the main unknown's frame, in the axes of its parent and about the
            parent's origin. A rotation has one twist, or three if every rotation is unobservable. The shape is (0, 6)
            for lenses and robot parameters.
        robot: Name of the robot with unobservable parameters; empty for other kinds.
        parameters: Kind of the unobservable robot parameters; empty for other kinds.
        joint: Index of the joint, from 0; None for parameters that are not per joint, and for other kinds.
        joint_name: Name of the joint; empty if there is none.
    """

    kind: Kind
    names: tuple[str, ...]
    twists_in_parent: Array
    robot: str = ""
    parameters: str = ""
    joint: int | None = None
    joint_name: str = ""


def separate_null_space(problem: Problem, state: State, vectors: Array, scale: Array) -> tuple[NullDirection, ...]:
    """Separate a null space into directions of a single kind.

    Args:
        problem: Problem with the p columns.
        state: State with the poses of the frames.
        vectors: (p, k) orthonormal basis, in units of `scale`.
        scale: (p,) unit of each column [m, rad, px].
    """
    others = [n for n in problem.columns if n not in problem.unknowns]
    of_transforms, of_others = _split_basis(vectors, problem.column_indices(others))
    rotating = [row for n in problem.columns if n in problem.unknowns for row in problem.column_indices([n])[3:]]
    translations, rotations = _split_basis(of_transforms, np.array(rotating, dtype=np.int64))
    directions = [_other_direction(problem, of_others[:, [k]]) for k in range(of_others.shape[1])]
    for space, is_rotation in ((translations, False), (rotations, True)):
        for cluster in _clusters(problem, space):
            # A basis of the part of the space that moves the cluster.
            rows = problem.column_indices(cluster)
            rotated = sort_by_share(space, rows)
            basis = np.zeros((len(space), int(np.sum(rotated.share > _LITTLE_SHARE))))
            basis[rows] = rotated.basis[rows, : basis.shape[1]] / rotated.share[: basis.shape[1]]
            directions += _cluster_directions(problem, state, basis, cluster, scale, is_rotation)
    return tuple(directions)


def orthonormal_rows(rows: Array) -> Array:
    """Orthonormal basis, (k, n), of the span of rows, without directions of small extent."""
    principal = principal_axes(rows, _LITTLE_SHARE)
    return principal.axes.T[: principal.dimension]


def _split_basis(vectors: Array, rows: IntArray) -> tuple[Array, Array]:
    """Split a basis into a part with little motion of some rows, and the rest."""
    rotated = sort_by_share(vectors, rows)
    return rotated.basis[:, rotated.share <= _LITTLE_SHARE], rotated.basis[:, rotated.share > _LITTLE_SHARE]


def _other_direction(problem: Problem, direction: Array) -> NullDirection:
    """Make the direction of a lens or of robot parameters from a vector (p, 1), with the names of coupled unknowns."""
    size = {name: float(np.linalg.norm(_block(problem, direction, name))) for name in problem.columns}
    main = max((name for name in size if name not in problem.unknowns), key=lambda name: size[name])
    names = _coupled_names(main, size)
    if main in problem.lenses:
        return NullDirection("lens", names, np.zeros((0, 6)))
    model = next(model for model in problem.models.values() if main in model.names)
    kind = model.names[main]
    null_direction = NullDirection("robot parameters", names, np.zeros((0, 6)), model.robot, kind)
    if not ROBOT_PARAMETERS[kind].is_by_joint:
        return null_direction
    joint = int(np.argmax(np.abs(model.columns[kind].basis @ _block(problem, direction, main))))
    return replace(null_direction, joint=joint, joint_name=model.chain.joint_names[joint])


def _coupled_names(main: str, sizes: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the main unknown and of those coupled with it, from the size of the motion of each."""
    return (main, *(name for name in sizes if name != main and sizes[name] > _COUPLED_SHARE * sizes[main]))


def _clusters(problem: Problem, space: Array) -> list[list[str]]:
    """Groups of names of transforms that move together, in the order of the problem."""
    names = [
        n
        for n in problem.columns
        if n in problem.unknowns and np.linalg.norm(_block(problem, space, n)) > _LEAST_CORRELATION
    ]
    clusters: list[list[str]] = []
    for name in names:
        own = _block(problem, space, name)
        correlated = {
            other for other in names if np.linalg.norm(own @ _block(problem, space, other).T) > _LEAST_CORRELATION
        }
        touching = [c for c in clusters if not correlated.isdisjoint(c)]
        clusters = [c for c in clusters if c not in touching] + [[n for c in touching for n in c] + [name]]
    return clusters


def _block(problem: Problem, space: Array, name: str) -> Array:
    block: Array = space[problem.columns[name]]
    return block


def _cluster_directions(
    problem: Problem, state: State, space: Array, cluster: Sequence[str], scale: Array, is_rotation: bool
) -> list[NullDirection]:
    """Separate a space of translations or rotations of a cluster by main unknowns, the largest motion first."""
    directions: list[NullDirection] = []
    while space.shape[1]:
        # The unknown that moves most; among similar ones the first, a base before mounts.
        size = {name: float(np.linalg.norm(space[_rotation_rows(problem, name, is_rotation)])) for name in cluster}
        main = next(name for name in cluster if size[name] >= _MAIN_SHARE * max(size.values()))
        rotated = sort_by_share(space, _rotation_rows(problem, main, is_rotation))
        moves = rotated.share > _LITTLE_SHARE * rotated.share[0]
        own, space = rotated.basis[:, moves], rotated.basis[:, ~moves]
        sizes = {name: float(np.linalg.norm(_block(problem, own, name))) for name in cluster}
        names = _coupled_names(main, sizes)
        parent_from_main = state.transforms[main]
        tangents = (own * scale[:, None])[problem.columns[main]].T
        if is_rotation:
            twists = tangents @ parent_from_main.adjoint().T
            parts = [twists] if len(twists) == 3 else twists[:, None]
            directions += [NullDirection("rotation", names, part) for part in parts]
        else:
            translations = orthonormal_rows(tangents[:, :3] @ parent_from_main.rotation.T)
            directions.append(
                NullDirection("translation", names, np.hstack([translations, np.zeros_like(translations)]))
            )
    return directions


def _rotation_rows(problem: Problem, name: str, is_rotation: bool) -> IntArray:
    """Rows of the rotation of an unknown, or of its translation."""
    return problem.column_indices([name])[slice(3, 6) if is_rotation else slice(0, 3)]


def separate_twists(twists: Array) -> tuple[Array, Array]:
    """Split a space of twists (k, 6) into orthonormal translations (i, 3) [m] and rotations (j, 6) [m, rad]."""
    translations, rotations = _split_basis(np.linalg.qr(twists.T)[0], np.arange(3, 6))
    return orthonormal_rows(translations[:3].T), rotations.T
