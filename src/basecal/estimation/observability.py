"""Which directions of the unknowns the data see.

The information is scaled to lengths of the scene and radians. A direction whose sigma would be above a third of
these is not seen; one without any information at all gets no number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem import Problem, State
from basecal.estimation.robot_model import DEFLECTION, LINKS
from basecal.geometry import Array

_UNSEEN_SIGMA = 0.3
_BLIND_SIGMA = 30.0
_ROUNDING = 1e-13
_TOUCHES = 1e-3
_SMALLEST_FACTOR = 1e-4
_DISTORTION_SCALE = 10.0
_ENOUGH_VIEWS = 40
_COMPLIANCE_SCALE = 0.01  # [rad/Nm]: 1 rad under 100 Nm


@dataclass(frozen=True, eq=False)
class Seen:
    """What the data see.

    Attributes:
        inverse: (p, p) inverse of the information, zero along directions without any.
        condition: Largest over smallest scaled sigma; infinite where a direction has no information.
        unseen: Each unseen direction in words.
        blind: Names of the transforms and lenses that have an unseen direction.
    """

    inverse: Array
    condition: float
    unseen: tuple[str, ...]
    blind: frozenset[str]


def seen_directions(problem: Problem, state: State, hessian: Array, factor: float) -> Seen:
    """What an information matrix (p, p), whose inverse times `factor` is the covariance, says of the unknowns."""
    if not len(hessian):
        return Seen(np.zeros((0, 0)), 1.0, (), frozenset())
    scale = _scales(problem, state)
    values, vectors = np.linalg.eigh(hessian * scale * scale[:, None])
    noise = max(factor, _SMALLEST_FACTOR)
    sigma = np.sqrt(noise / np.maximum(values, 1e-300))
    blind = (sigma > _BLIND_SIGMA) | (values < _ROUNDING * values[-1])
    kept = vectors[:, ~blind] * scale[:, None]
    inverse = (kept / values[~blind]) @ kept.T
    shaping = np.linalg.norm(vectors[_distortion_columns(problem)], axis=0) ** 2 > 0.5
    unseen = blind | ((sigma > _UNSEEN_SIGMA) & ~shaping)
    words = tuple(_in_words(problem, vectors[:, k]) for k in np.flatnonzero(unseen))
    names = frozenset(
        name
        for name, where in problem.columns.items()
        if np.abs(vectors[where][:, blind]).max(initial=0.0) > _TOUCHES
        or np.sqrt(noise * np.diag(inverse)[where] / scale[where] ** 2)[: _gated(problem, name)].max(initial=0.0)
        > _UNSEEN_SIGMA
    )
    condition = float(np.sqrt(values[-1] / values[0])) if not np.any(blind) else float("inf")
    return Seen(inverse, condition, words, names)


def _gated(problem: Problem, name: str) -> int:
    """How many leading columns of an unknown must be seen: all of a transform, focal lengths and centre of a lens.

    Of a robot's kinematics none: each number is given or not by itself.
    """
    return 6 if name in problem.unknowns else 4 if name in problem.lenses else 0


def _distortion_columns(problem: Problem) -> list[int]:
    lenses = [where for name, where in problem.columns.items() if name in problem.lenses]
    return [k for where in lenses for k in range(where.start + 4, where.stop)]


def _scales(problem: Problem, state: State) -> Array:
    """What one scaled unit of each column is: a length of the scene [m], 1 rad, an image width [px]."""
    few = [g.take(slice(None, None, -(-len(g) // _ENOUGH_VIEWS))) for g in problem.groups if len(g)]
    distances = [np.linalg.norm(state.camera_from_target(g, problem.stops).translation, axis=-1) for g in few]
    length = max(float(np.median(np.concatenate(distances))), 1e-3) if distances else 1.0
    scale = np.ones(problem.width)
    for name, where in problem.columns.items():
        if name in problem.unknowns:
            scale[where.start : where.start + 3] = length
        elif name.endswith(DEFLECTION):
            scale[where] = _COMPLIANCE_SCALE
        elif name in problem.lenses:
            camera = state.cameras[name]
            scale[where] = _DISTORTION_SCALE
            scale[where.start : where.start + 4] = float(camera.focal.mean())
    return scale


def _in_words(problem: Problem, vector: Array) -> str:
    """A direction as the turn or shift of the unknown that moves most, and of those that go along."""
    size = {name: float(np.linalg.norm(vector[where])) for name, where in problem.columns.items()}
    ordered = sorted(size, key=lambda name: (-round(size[name], 3), name))
    first = ordered[0]
    along = [name for name in ordered[1:] if size[name] > 0.3 * size[first]]
    text = _motion(problem, vector, first)
    return f"{text}, together with {' and '.join(along)}" if along else text


def _motion(problem: Problem, vector: Array, name: str) -> str:
    part = vector[problem.columns[name]]
    if name in problem.lenses:
        return f"the lens of {name}"
    if name not in problem.unknowns:
        return _of_robot(problem, part, name)
    source = name.split("_from_")[1]
    shift, turn = part[:3], part[3:]
    is_turn = len(turn) and np.linalg.norm(turn) >= np.linalg.norm(shift)
    axis = turn if is_turn else shift
    axis = axis / np.linalg.norm(axis) * np.sign(axis[np.argmax(np.abs(axis))])
    shown = ", ".join(f"{v:+.2f}" for v in axis)
    motion, about = ("turn", "about") if is_turn else ("shift", "along")
    return f"a {motion} of {name} {about} ({shown}) in the axes of {source}"


def _of_robot(problem: Problem, part: Array, name: str) -> str:
    """The offset of the joint that turns most, or the links of its robot."""
    model = next(model for model in problem.models.values() if name in model.widths)
    if name.endswith(LINKS):
        return f"an error of the links of {model.robot}"
    what, joints = ("compliance", model.elastic) if name.endswith(DEFLECTION) else ("offset", model.joints)
    joint = int(joints[np.argmax(np.abs(part))])
    return f"the {what} of joint {joint + 1} of {model.robot} ({model.chain.joint_names[joint]})"
