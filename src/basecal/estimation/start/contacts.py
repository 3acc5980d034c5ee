"""Start values from contacts other than points: planes and edges through touching tips, hinges and rigid parts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.start.rotation_search import icosahedral_rotations
from basecal.estimation.view.contacts import ContactMeasurement, GripMeasurement, HingeMeasurement, PlaneMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import principal_axes


def without_contacts(problem: Problem) -> Problem:
    """Return a problem of points and poses only.

    Each grip becomes an identity pose and replaces all other views of its part. Other contacts are removed; the mounts
    of hinges become points.
    """
    if not any(isinstance(g.measurement, ContactMeasurement) for g in problem.groups):
        return problem
    hinges = {end.mount for g in problem.groups if isinstance(g.measurement, HingeMeasurement) for end in g.ends}
    groups = [_as_poses(g) for g in problem.groups if isinstance(g.measurement, GripMeasurement)]
    rigid = {g.camera for g in groups}
    groups += [g for g in problem.groups if not isinstance(g.measurement, ContactMeasurement) and g.camera not in rigid]
    return replace(problem.with_groups(groups), point_mounts=problem.point_mounts | hinges)


def rigid_part_mounts(problem: Problem) -> dict[str, SE3]:
    """Start values of the mounts of rigid parts: the identity at the flange of the eye, by name."""
    return {g.eye.mount: SE3.identity() for g in problem.groups if isinstance(g.measurement, GripMeasurement)}


def _as_poses(group: ViewGroup) -> ViewGroup:
    ones = np.ones((len(group), 6))
    return replace(group, measurement=PoseMeasurement(SE3.identity((len(group),)), ones, ones))


def place_contacts(problem: Problem, transforms: Mapping[str, SE3]) -> dict[str, SE3]:
    """Mounts of planes, edges, hinges and rigid parts, given all other transforms, by name.

    Args:
        problem: The problem.
        transforms: Transforms of bases, tips and origins of hinges.
    """
    placed: dict[str, SE3] = {}
    for group in problem.groups:
        if isinstance(group.measurement, HingeMeasurement):
            placed |= _hinge_mounts(group, transforms)
        elif isinstance(group.measurement, GripMeasurement):
            placed |= _part_mounts(group, transforms)
    groups = [g for g in problem.groups if _is_surface(g)]
    for name in {g.hand.mount: None for g in groups}:
        touching = [g for g in groups if g.hand.mount == name]
        # Prefer contacts of the reference, whose base is known; the bases of others are approximate.
        preferred = [g for g in touching if g.eye.base is None] or touching
        points = np.concatenate([_flanges(g.eye, transforms) @ transforms[g.eye.mount].translation for g in preferred])
        is_plane = isinstance(touching[0].measurement, PlaneMeasurement)
        axes = principal_axes(points - points.mean(0)).axes
        placed[name] = SE3(_z_rotation(axes[:, 2 if is_plane else 0]), points.mean(0))
    return placed


def rotated_base_states(problem: Problem, state: State, known_names: Collection[str]) -> Iterator[State]:
    """Yield states with each base that touches planes or edges rotated about its contacts, including the given state.

    The rotations are those of `icosahedral_rotations`.
    """
    touching = [g for g in problem.groups if _is_surface(g)]
    for base in sorted({g.eye.base for g in touching if g.eye.base is not None} - set(known_names)):
        flanges = [_flanges(g.eye, state.transforms).translation for g in touching if g.eye.base == base]
        centre = np.concatenate(flanges).mean(0)
        for rotation in icosahedral_rotations():
            rotated = SE3(rotation, centre - rotation @ centre) @ state.transforms[base]
            transforms = {**state.transforms, base: rotated}
            placed = {
                name: mount for name, mount in place_contacts(problem, transforms).items() if name not in known_names
            }
            yield replace(state, transforms={**transforms, **placed})


def _is_surface(group: ViewGroup) -> bool:
    return isinstance(group.measurement, ContactMeasurement) and group.hand.robot is None


def _hinge_mounts(group: ViewGroup, transforms: Mapping[str, SE3]) -> dict[str, SE3]:
    """Mounts of both ends of a hinge, with z along the directions in the flanges that stay parallel."""
    eye, hand = group.ends
    rows = np.concatenate([_flanges(eye, transforms).rotation, -_flanges(hand, transforms).rotation], -1)
    axes = principal_axes(rows.reshape(-1, 6)).axes[:, -1].reshape(2, 3)
    ends = zip(group.ends, axes, strict=True)
    return {
        end.mount: SE3(_z_rotation(axis / np.linalg.norm(axis)), transforms[end.mount].translation)
        for end, axis in ends
    }


def _part_mounts(group: ViewGroup, transforms: Mapping[str, SE3]) -> dict[str, SE3]:
    """Mounts of both ends of a rigid part, halfway between the flanges to decorrelate translation and rotation."""
    hand_flange_from_eye_flange = transforms[group.hand.mount]
    half = SE3(np.eye(3), hand_flange_from_eye_flange.inverse().translation / 2)
    return {group.eye.mount: half, group.hand.mount: hand_flange_from_eye_flange @ half}


def _flanges(end: End, transforms: Mapping[str, SE3]) -> SE3:
    """Poses `world_from_flange` of the views of an end, (n,)."""
    return end.world_from_base(transforms) @ end.base_from_flange


def _z_rotation(axis: Array) -> Array:
    """Rotation, (3, 3), whose z axis is the given unit vector."""
    _, x, y = principal_axes(axis[None]).axes.T
    return np.stack([x if np.cross(x, y) @ axis > 0 else -x, y, axis], -1)
