"""Descriptions of unobservable directions, such as any translation of a frame or its rotation about an axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.estimation.observability.null_space import NullDirection, separate_twists
from basecal.geometry import Array

_PITCH_M = 0.02  # [m/rad] pitch of a screw motion, below which it is described as a plain rotation; assumed


def describe_null_space(direction: NullDirection) -> str:
    """Describe a direction with its coupling: "any translation of hand_base, coupled with hand_flange_from_board"."""
    coupled = f", coupled with {' and '.join(direction.names[1:])}" if direction.names[1:] else ""
    return describe_direction(direction) + coupled


def unobservable_clause(phrases: Sequence[str], names: Sequence[str]) -> str:
    """Clause that several directions, which move the same unknowns, are unobservable."""
    verb, coupled = "is" if len(phrases) == 1 else "are", " and ".join(names)
    return f"{' and '.join(phrases)} {verb} unobservable{f' (coupled with {coupled})' if names else ''}"


def describe_direction(direction: NullDirection) -> str:
    """Describe the motion of the unknown that moves most, such as "any translation of hand_base"."""
    main, twists = direction.names[0], direction.twists_in_parent
    match direction.kind:
        case "lens":
            return f"the intrinsics of {main}"
        case "robot parameters":
            parameter = ROBOT_PARAMETERS[direction.parameters].singular
            if direction.joint is None:
                return f"{parameter} of {direction.robot}"
            return f"{parameter} of joint {direction.joint + 1} of {direction.robot} ({direction.joint_name})"
        case "translation":
            parent, frame = main.split("_from_")
            return _translation(frame, twists[:, :3], parent)
        case "rotation":
            parent, frame = main.split("_from_")
            return f"any rotation of {frame}" if len(twists) == 3 else _rotation(frame, twists[0], parent)


def describe_twists(frame: str, twists: Array) -> str:
    """Describe unobservable twists of a robot's base in its own axes, (k, 6) [m, rad]."""
    if len(twists) == 6:
        return f"any translation or rotation of {frame}"
    directions, rotations = separate_twists(twists)
    parts = [_translation(frame, directions, frame)] if len(directions) else []
    return " and ".join([*parts, *(_rotation(frame, twist, frame) for twist in rotations)])


def _translation(frame: str, directions: Array, parent: str) -> str:
    """Describe translations of a frame along orthonormal directions in the parent's axes, (m, 3)."""
    if len(directions) == 3:
        return f"any translation of {frame}"
    if len(directions) == 2:
        normal = np.cross(directions[0], directions[1])
        return f"any translation of {frame} perpendicular to {_axis(normal)} in {parent}"
    return f"translation of {frame} along {_axis(directions[0])} in {parent}"


def _rotation(frame: str, twist: Array, parent: str) -> str:
    """Describe the rotation of a frame by a twist, (6,) [m, rad], in the parent's axes and about its origin."""
    translation, rotation = twist[:3], twist[3:]
    square = float(rotation @ rotation)
    through, pitch = np.cross(rotation, translation) / square, float(rotation @ translation) / square
    screw = f", with {1e3 * abs(pitch) * np.pi / 180:.1f} mm along it per degree" if abs(pitch) > _PITCH_M else ""
    line = f"the axis through {_numbers(through)} m along {_axis(rotation)} in {parent}"
    return f"rotation of {frame} about {line}{screw}"


def _axis(direction: Array) -> str:
    """Format a direction without a sign: its largest component is positive."""
    unit = direction / np.linalg.norm(direction)
    return _numbers(unit * np.sign(unit[np.argmax(np.round(np.abs(unit), 3))]))


def _numbers(values: Array) -> str:
    return "(" + ", ".join(f"{round(float(v), 2) + 0.0:.2f}" for v in values) + ")"
