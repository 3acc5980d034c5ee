"""The directions that the data leave open, taken apart into translations and rotations of frames.

They come as a basis of their space, in which translations and rotations of several unknowns are mixed at will. First
what moves a lens or a robot's kinematics is taken out, then what does not rotate, then what does not hang together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import principal_axes, sort_by_share

# Singular values and norms of an orthonormal basis, in shares of a whole direction.
_LITTLE_SHARE = 0.2  # what a basis moves less of an unknown than this does not move it; assumed
_LEAST_CORRELATION = 0.05  # unknowns whose parts are less correlated than this move apart; assumed
_MAIN_SHARE = 0.5  # of unknowns that move this share of the largest the first is named; assumed
_COUPLED_SHARE = 0.3  # what moves this share of the named one moves along with it; assumed

Kind = Literal["translation", "rotation", "lens", "robot parameters"]


@dataclass(frozen=True, eq=False)
class NullDirection:
    """A direction that the data leave open, or several of the same kind.

    Attributes:
        kind: What moves.
        names: The unknowns that move, that which moves most first.
        twists_in_parent: (k, 6) [m, rad] how the first one's frame moves, in the axes of its parent and about the
            parent's origin. A rotation has one twist, or three if every rotation is open. The shape is (0, 6) for all
            that is not a transform.
        robot: Whose kinematics move; empty if it is none.
        parameters: What kind of them move; empty if none do.
        joint: Which joint of it, from 0; None if it is none.
        joint_name: The name of that joint.
    """

    kind: Kind
    names: tuple[str, ...]
    twists_in_parent: Array
    robot: str = ""
    parameters: str = ""
    joint: int | None = None
    joint_name: str = ""


def separate_null_space(problem: Problem, state: State, vectors: Array, scale: Array) -> tuple[NullDirection, ...]:
    """A null space taken apart.

    Args:
        problem: Whose columns they are.
        state: Where the frames stand.
        vectors: (p, k) an orthonormal basis, in units of `scale`.
        scale: (p,) what one unit of each column is [m, rad, px].
    """
    others = [n for n in problem.columns if n not in problem.unknowns]
    rest, of_others = _split_basis(vectors, problem.column_indices(others))
    rotating = [row for n in problem.columns if n in problem.unknowns for row in problem.column_indices([n])[3:]]
    translations, rotations = _split_basis(rest, np.array(rotating, dtype=np.int64))
    found = [_other_direction(problem, of_others[:, [k]]) for k in range(of_others.shape[1])]
    for space, is_rotation in ((translations, False), (rotations, True)):
        for cluster in _clusters(problem, space):
            # A basis of the part of the space that moves the cluster.
            rows = problem.column_indices(cluster)
            turned = sort_by_share(space, rows)
            basis = np.zeros((len(space), int(np.sum(turned.share > _LITTLE_SHARE))))
            basis[rows] = turned.basis[rows, : basis.shape[1]] / turned.share[: basis.shape[1]]
            found += _cluster_directions(problem, state, basis, cluster, scale, is_rotation)
    return tuple(found)


def orthonormal_rows(rows: Array) -> Array:
    """An orthonormal basis of what some rows span, (k, n), but for what is little."""
    of = principal_axes(rows, _LITTLE_SHARE)
    return of.axes.T[: of.dimension]


def _split_basis(vectors: Array, rows: IntArray) -> tuple[Array, Array]:
    """A basis of what hardly moves some rows, and of the rest."""
    turned = sort_by_share(vectors, rows)
    return turned.basis[:, turned.share <= _LITTLE_SHARE], turned.basis[:, turned.share > _LITTLE_SHARE]


def _other_direction(problem: Problem, direction: Array) -> NullDirection:
    """A direction of a lens or of whatever is no transform, (p, 1), and what moves along."""
    size = {name: float(np.linalg.norm(_block(problem, direction, name))) for name in problem.columns}
    main = max((name for name in size if name not in problem.unknowns), key=lambda name: size[name])
    names = (main, *(name for name in size if name != main and size[name] > _COUPLED_SHARE * size[main]))
    if main in problem.lenses:
        return NullDirection("lens", names, np.zeros((0, 6)))
    model = next(model for model in problem.models.values() if main in model.names)
    kind = model.names[main]
    found = NullDirection("robot parameters", names, np.zeros((0, 6)), model.robot, kind)
    if not ROBOT_PARAMETERS[kind].is_by_joint:
        return found
    joint = int(np.argmax(np.abs(model.columns[kind].basis @ _block(problem, direction, main))))
    return replace(found, joint=joint, joint_name=model.chain.joint_names[joint])


def _clusters(problem: Problem, space: Array) -> list[list[str]]:
    """Names of transforms that move together, in the problem's order."""
    names = [
        n
        for n in problem.columns
        if n in problem.unknowns and np.linalg.norm(_block(problem, space, n)) > _LEAST_CORRELATION
    ]
    clusters: list[list[str]] = []
    for name in names:
        own = _block(problem, space, name)
        alike = {other for other in names if np.linalg.norm(own @ _block(problem, space, other).T) > _LEAST_CORRELATION}
        touching = [c for c in clusters if not alike.isdisjoint(c)]
        clusters = [c for c in clusters if c not in touching] + [[n for c in touching for n in c] + [name]]
    return clusters


def _block(problem: Problem, space: Array, name: str) -> Array:
    block: Array = space[problem.columns[name]]
    return block


def _cluster_directions(
    problem: Problem, state: State, space: Array, cluster: Sequence[str], scale: Array, is_rotation: bool
) -> list[NullDirection]:
    """A space of translations or of rotations of a cluster, by what moves most, that first."""
    found: list[NullDirection] = []
    while space.shape[1]:
        # What moves most; of several alike the first, a base before mounts.
        size = {name: float(np.linalg.norm(space[_rotation_rows(problem, name, is_rotation)])) for name in cluster}
        main = next(name for name in cluster if size[name] >= _MAIN_SHARE * max(size.values()))
        turned = sort_by_share(space, _rotation_rows(problem, main, is_rotation))
        moves = turned.share > _LITTLE_SHARE * turned.share[0]
        own, space = turned.basis[:, moves], turned.basis[:, ~moves]
        along = {name: float(np.linalg.norm(_block(problem, own, name))) for name in cluster}
        names = (main, *(name for name in cluster if name != main and along[name] > _COUPLED_SHARE * along[main]))
        at = state.transforms[main]
        tangents = (own * scale[:, None])[problem.columns[main]].T
        if is_rotation:
            twists = tangents @ at.adjoint().T
            parts = [twists] if len(twists) == 3 else twists[:, None]
            found += [NullDirection("rotation", names, part) for part in parts]
        else:
            directions = orthonormal_rows(tangents[:, :3] @ at.rotation.T)
            found.append(NullDirection("translation", names, np.hstack([directions, np.zeros_like(directions)])))
    return found


def _rotation_rows(problem: Problem, name: str, is_rotation: bool) -> IntArray:
    """Rows of an unknown's rotation, or of its translation."""
    return problem.column_indices([name])[slice(3, 6) if is_rotation else slice(0, 3)]


def separate_twists(twists: Array) -> tuple[Array, Array]:
    """Translations (i, 3) [m], orthonormal, and twists with rotations (j, 6) [m, rad] of a space of twists, (k, 6)."""
    translations, rotations = _split_basis(np.linalg.qr(twists.T)[0], np.arange(3, 6))
    return orthonormal_rows(translations[:3].T), rotations.T
