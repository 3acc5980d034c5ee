"""Directions of the unknowns in words: any shift of a frame, a shift along a line, a turn about an axis.

Directions that are not seen come as a basis of their space, in which shifts and turns of several unknowns are mixed at
will. They are taken apart: first what moves the lens, then what does not turn, then what does not hang together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import DEFLECTION, LINKS
from basecal.geometry import Array, IntArray

_LITTLE = 0.2
_APART = 0.05
_MAIN = 0.5
_ALONG = 0.3
_PITCH_M = 0.02


@dataclass(frozen=True)
class NullSpace:
    """Directions that the data do not see.

    Attributes:
        what: Of what moves most, such as "any shift of hand_base".
        names: What moves, most of all the first.
    """

    what: str
    names: tuple[str, ...]

    @property
    def words(self) -> str:
        """Such as "any shift of hand_base, together with hand_flange_from_board"."""
        return and_along([self.what], self.names[1:])


def and_along(whats: Sequence[str], others: Sequence[str]) -> str:
    """What is not seen, and what moves along with it."""
    together = f", together with {' and '.join(others)}" if others else ""
    return " and ".join(whats) + together


def describe_null_space(problem: Problem, state: State, vectors: Array, scale: Array) -> tuple[NullSpace, ...]:
    """A space of directions taken apart.

    Args:
        problem: Whose columns they are.
        state: Where the frames stand.
        vectors: (p, k) an orthonormal basis, in units of `scale`.
        scale: (p,) what one unit of each column is [m, rad, px].
    """
    others = [n for n in problem.columns if n not in problem.unknowns]
    rest, of_others = _apart(vectors, _rows(problem, others))
    turning = [row for n in problem.columns if n in problem.unknowns for row in _rows(problem, [n])[3:]]
    shifts, turns = _apart(rest, np.array(turning, dtype=np.int64))
    told = [_of_other(problem, of_others[:, [k]]) for k in range(of_others.shape[1])]
    for space, is_turn in ((shifts, False), (turns, True)):
        for cluster in _clusters(problem, space):
            told += _told(problem, state, _within(problem, space, cluster), cluster, scale, is_turn)
    return tuple(told)


def shift_in_words(frame: str, directions: Array, parent: str) -> str:
    """Shifts of a frame along (m, 3) orthonormal directions in the parent's axes."""
    if len(directions) == 3:
        return f"any shift of {frame}"
    if len(directions) == 2:
        return f"any shift of {frame} across {_axis(np.cross(directions[0], directions[1]))} in {parent}"
    return f"a shift of {frame} along {_axis(directions[0])} in {parent}"


def turn_in_words(frame: str, twist: Array, parent: str) -> str:
    """A turn of a frame by a twist, (6,) [m, rad], in the parent's axes and about its origin."""
    shift, turn = twist[:3], twist[3:]
    size = float(turn @ turn)
    through, pitch = np.cross(turn, shift) / size, float(turn @ shift) / size
    climb = f", with {1e3 * abs(pitch) * np.pi / 180:.1f} mm along it per degree" if abs(pitch) > _PITCH_M else ""
    return f"a turn of {frame} about the axis through {_numbers(through)} m along {_axis(turn)} in {parent}{climb}"


def twists_in_words(frame: str, twists: Array) -> str:
    """Twists of a robot's base in its own axes, (k, 6) [m, rad], such as a recording alone leaves open."""
    count = len(twists)
    if count == 6:
        return f"any shift or turn of {frame}"
    basis = np.linalg.qr(twists.T)[0]
    shifts, turns = _apart(basis, np.arange(3, 6))
    parts = [shift_in_words(frame, _orthonormal(shifts[:3].T), frame)] if shifts.shape[1] else []
    return " and ".join([*parts, *(turn_in_words(frame, twist, frame) for twist in turns.T)])


def _orthonormal(rows: Array) -> Array:
    _, values, axes = np.linalg.svd(rows, full_matrices=False)
    found: Array = axes[values > _LITTLE * values[0]]
    return found


def _axis(direction: Array) -> str:
    """A direction without its sense: its largest component positive."""
    unit = direction / np.linalg.norm(direction)
    unit = unit * np.sign(unit[np.argmax(np.round(np.abs(unit), 3))])
    return _numbers(unit)


def _numbers(values: Array) -> str:
    return "(" + ", ".join(f"{round(float(v), 2) + 0.0:.2f}" for v in values) + ")"


def _rows(problem: Problem, names: Sequence[str]) -> IntArray:
    return np.array(
        [k for n in names for k in range(problem.columns[n].start, problem.columns[n].stop)], dtype=np.int64
    )


def _apart(vectors: Array, rows: IntArray) -> tuple[Array, Array]:
    """A basis of what hardly moves some rows, and of the rest."""
    if not len(rows) or not vectors.shape[1]:
        return vectors, vectors[:, :0]
    _, values, mix = np.linalg.svd(vectors[rows], full_matrices=True)
    padded = np.zeros(vectors.shape[1])
    padded[: len(values)] = values
    turned = vectors @ mix.T
    return turned[:, padded <= _LITTLE], turned[:, padded > _LITTLE]


def _of_other(problem: Problem, direction: Array) -> NullSpace:
    """A direction of a lens or of whatever is no transform, (p, 1), and what moves along."""
    size = {name: float(np.linalg.norm(_block(problem, direction, name))) for name in problem.columns}
    main = max((name for name in size if name not in problem.unknowns), key=lambda name: size[name])
    along = [name for name in size if name != main and size[name] > _ALONG * size[main]]
    what = (
        f"the lens of {main}" if main in problem.lenses else _of_robot(problem, _block(problem, direction, main), main)
    )
    return NullSpace(what, (main, *along))


def _of_robot(problem: Problem, part: Array, name: str) -> str:
    """The offset of the joint that turns most, or the links of its robot."""
    model = next(model for model in problem.models.values() if name in model.widths)
    if name.endswith(LINKS):
        return f"an error of the links of {model.robot}"
    what, joints = ("compliance", model.elastic) if name.endswith(DEFLECTION) else ("offset", model.joints)
    joint = int(joints[np.argmax(np.abs(part))])
    return f"the {what} of joint {joint + 1} of {model.robot} ({model.chain.joint_names[joint]})"


def _clusters(problem: Problem, space: Array) -> list[list[str]]:
    """Names of transforms that move together, in the problem's order."""
    names = [n for n in problem.columns if n in problem.unknowns and np.linalg.norm(_block(problem, space, n)) > _APART]
    clusters: list[list[str]] = []
    for name in names:
        touching = [c for c in clusters if any(_linked(problem, space, name, other) for other in c)]
        clusters = [c for c in clusters if c not in touching] + [[n for c in touching for n in c] + [name]]
    return clusters


def _block(problem: Problem, space: Array, name: str) -> Array:
    block: Array = space[problem.columns[name]]
    return block


def _linked(problem: Problem, space: Array, a: str, b: str) -> bool:
    return bool(np.linalg.norm(_block(problem, space, a) @ _block(problem, space, b).T) > _APART)


def _within(problem: Problem, space: Array, cluster: Sequence[str]) -> Array:
    """A basis of the part of a space that moves a cluster."""
    rows = _rows(problem, cluster)
    left, values, _ = np.linalg.svd(space[rows], full_matrices=False)
    basis = np.zeros((len(space), int(np.sum(values > _LITTLE))))
    basis[rows] = left[:, : basis.shape[1]]
    return basis


def _told(
    problem: Problem, state: State, space: Array, cluster: Sequence[str], scale: Array, is_turn: bool
) -> list[NullSpace]:
    """Words of a space of shifts or of turns of a cluster, that of what moves most first."""
    told: list[NullSpace] = []
    while space.shape[1]:
        main = _main(problem, space, cluster, is_turn)
        part = _half(problem, space, main, is_turn)
        _, values, mix = np.linalg.svd(part, full_matrices=True)
        moves = np.zeros(space.shape[1], dtype=bool)
        moves[: len(values)] = values > _LITTLE * values[0]
        ordered = space @ mix.T
        told += _of_main(problem, state, ordered[:, moves], main, cluster, scale, is_turn)
        space = ordered[:, ~moves]
    return told


def _half(problem: Problem, space: Array, name: str, is_turn: bool) -> Array:
    return _block(problem, space, name)[slice(3, 6) if is_turn else slice(0, 3)]


def _main(problem: Problem, space: Array, cluster: Sequence[str], is_turn: bool) -> str:
    """What moves most; of several alike the first, a base before mounts."""
    size = {name: float(np.linalg.norm(_half(problem, space, name, is_turn))) for name in cluster}
    return next(name for name in cluster if size[name] >= _MAIN * max(size.values()))


def _of_main(
    problem: Problem, state: State, space: Array, main: str, cluster: Sequence[str], scale: Array, is_turn: bool
) -> list[NullSpace]:
    parent, frame = main.split("_from_")
    size = {name: float(np.linalg.norm(_block(problem, space, name))) for name in cluster}
    others = [name for name in cluster if name != main and size[name] > _ALONG * size[main]]
    names = (main, *others)
    at = state.transforms[main]
    tangents = (space * scale[:, None])[problem.columns[main]].T
    if not is_turn:
        directions = _orthonormal(tangents[:, :3] @ at.rotation.T)
        return [NullSpace(shift_in_words(frame, directions, parent), names)]
    if space.shape[1] == 3:
        return [NullSpace(f"any turn of {frame}", names)]
    twists = tangents @ at.adjoint().T
    return [NullSpace(turn_in_words(frame, twist, parent), names) for twist in twists]
