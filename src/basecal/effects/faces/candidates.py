"""The interface of effects to the views of a solved problem, and the candidates of score tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.kinematics import SerialChain

Moves = tuple[Array | None, ...]
"""For each group of views, (n, 6, q) right tangents of `camera_from_target` by unit sizes; None if it is unaffected."""


class End(Protocol):
    """One end of n views: the camera or the target that a robot carries."""

    @property
    def mount(self) -> str:
        """Name of the mount: the transform from the flange to the camera or target."""

    @property
    def joints(self) -> Array | None:
        """Recorded joints of the robot, (n, joints) [rad]."""


class Group(Protocol):
    """Views of one target by one camera, n of them."""

    @property
    def camera(self) -> str:
        """Name of the camera."""

    @property
    def target(self) -> str:
        """Name of the target."""

    @property
    def sample(self) -> IntArray:
        """Numbers of the samples, (n,)."""

    @property
    def eye(self) -> End:
        """The end of the camera."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the transforms that the views depend on: mounts and bases."""

    def robot_end(self, robot: str) -> End | None:
        """The end that a robot carries; None if it carries neither camera nor target."""

    def __len__(self) -> int:
        """Number of views."""


class Views(Protocol):
    """All views in groups; derivatives are right tangents of `camera_from_target`."""

    @property
    def groups(self) -> tuple[Group, ...]:
        """The groups."""

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots that were recorded at more than one pose."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the transforms that views depend on: mounts and bases."""

    @property
    def fixed_frames(self) -> tuple[str, ...]:
        """The frames that are stated as fixed."""

    @property
    def point_mounts(self) -> frozenset[str]:
        """The mounts of single points, whose rotation has no effect."""

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the targets that have a size."""

    @property
    def chains(self) -> Mapping[str, SerialChain]:
        """Stated kinematics of each robot with recorded joints."""

    @property
    def estimated_effects(self) -> Mapping[str, frozenset[str]]:
        """Names of the effects that are estimated as unknowns of each robot, camera or target."""

    @property
    def samples(self) -> IntArray:
        """Numbers of all recorded samples in temporal order."""

    @property
    def times(self) -> Array:
        """Times of `samples` [s], or their indices if `has_times` is false."""

    @property
    def has_times(self) -> bool:
        """Whether all samples have a time and the times differ."""

    @property
    def mounts(self) -> Mapping[str, str]:
        """Names of the mounts on robots that were recorded at more than one pose, with the robot of each."""

    def down_in_flange(self, k: int, robot: str) -> Array:
        """Direction of gravity in the flange of a robot that carries the camera or target of a group, (n, 3)."""

    def transform(self, name: str) -> SE3:
        """The transform with this name, a mount or a base."""

    def sample_indices(self, group: Group) -> IntArray:
        """Indices of the samples of a group's views in `samples`, (n,)."""

    def flange_jacobian(self, k: int, robot: str) -> Array:
        """Derivatives of a group's views with respect to a right tangent of a robot's flange, (n, 6, 6)."""

    def depends(self, k: int, name: str) -> bool:
        """Whether views of a group depend on a transform."""

    def frame_jacobian(self, k: int, name: str) -> Array:
        """Derivatives of a group's views with respect to a right tangent of a transform, (n, 6, 6)."""

    def target_from_camera(self, k: int) -> SE3:
        """Poses of the camera in the target for the views of a group, (n,)."""

    def recorded_pose(self, k: int, robot: str) -> SE3:
        """Recorded flange poses of a robot for a group's views, (n,); identity if the robot carries nothing there."""

    def velocity(self, robot: str) -> Array | None:
        """Body velocity of a robot at each of `samples`, (n, 6) per unit of `times`; None if it follows no path."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Possible effects of one kind, each with the same number of sizes.

    Attributes:
        code: Kind of candidate, such as `joint-offset`, which selects the description of its effect.
        about: For each candidate, the robot, camera, target or transform that it concerns.
        since: For each candidate, the number of the first affected sample; None if all samples are affected.
        unit: Unit of the sizes.
        moves: For each group of views, (n, b, 6, q) right tangents of `camera_from_target` by unit sizes of b
            candidates. It is None for a group that no candidate affects.
        joint: For each candidate, the index of its joint, from 0; empty if the candidates concern no single joint.
    """

    code: str
    about: tuple[str, ...]
    since: tuple[int | None, ...]
    unit: str
    moves: tuple[Array | None, ...]
    joint: tuple[int, ...] = ()

    @property
    def sizes(self) -> int:
        """Number of sizes of each candidate."""
        return int(next(m.shape[-1] for m in self.moves if m is not None))

    def single(self, index: int) -> Candidates:
        """The candidate with an index."""
        moves = tuple(None if m is None else m[:, index : index + 1].copy() for m in self.moves)
        joint = self.joint[index : index + 1]
        return Candidates(self.code, (self.about[index],), (self.since[index],), self.unit, moves, joint)

    def join_sizes(self) -> Candidates:
        """Merge all candidates into one that has the sizes of all."""
        moves = (None if m is None else np.moveaxis(m, 1, 2).reshape(len(m), 1, 6, -1) for m in self.moves)
        return Candidates(self.code, self.about[:1], self.since[:1], self.unit, tuple(moves))


def one_candidate(code: str, subject: str, unit: str, moves: tuple[Array | None, ...]) -> Candidates:
    """A single candidate, from moves of (n, 6, q) for each group."""
    return Candidates(code, (subject,), (None,), unit, tuple(None if m is None else m[:, None] for m in moves))


def combine_candidates(candidates: Sequence[Candidates], views: Views) -> Candidates:
    """Merge single candidates of different kinds into one that has the sizes of all."""

    def moves(k: int) -> Array:
        """Moves of a group for all sizes, (n, 1, 6, q)."""
        still = np.zeros((len(views.groups[k]), 1, 6, 0))
        parts = [(np.zeros((*still.shape[:3], each.sizes)), each.moves[k]) for each in candidates]
        return np.concatenate([still, *(none if own is None else own for none, own in parts)], axis=-1)

    return Candidates("", ("",), (None,), "", tuple(map(moves, range(len(views.groups)))))


def robot_moves(views: Views, robot: str, move: Callable[[Views, int, str], Array]) -> Moves:
    """Moves of the groups whose camera or target is on a robot; None for other groups."""
    return tuple(move(views, k, robot) if g.robot_end(robot) else None for k, g in enumerate(views.groups))


def pose_moves(views: Views, robot: str, tangents: Callable[[SE3], Array]) -> Moves:
    """Moves of views by tangents of a robot's flange, (n, 6, q), at its recorded poses, (n,)."""

    def moves(views: Views, k: int, robot: str) -> Array:
        """Moves of a group."""
        return np.asarray(views.flange_jacobian(k, robot) @ tangents(views.recorded_pose(k, robot)))

    return robot_moves(views, robot, moves)


def mount_moves(views: Views, mount: str, move: Callable[[Array], Array]) -> Moves:
    """Moves of the groups that depend on a mount, by an effect of gravity on the mount.

    An estimated mount is defined as its pose under the mean direction of gravity over the recorded poses. An effect
    that is equal at all poses therefore adds no uncertainty.

    Args:
        views: The views.
        mount: A mount on a robot.
        move: Linear function from directions of gravity in the flange, (n, 3), to tangents of the flange, (n, 6, q).
    """
    robot = views.mounts[mount]
    downs = {k: views.down_in_flange(k, robot) for k, g in enumerate(views.groups) if mount in g.frames}
    mean_down = 0.0 if mount in views.fixed_frames else np.concatenate(list(downs.values())).mean(0)
    return tuple(
        views.flange_jacobian(k, robot) @ move(downs[k] - mean_down) if k in downs else None
        for k in range(len(views.groups))
    )


def frame_candidates(
    code: str, views: Views, name: str, shares: Array | BoolArray, first_samples: tuple[int | None, ...] = (None,)
) -> Candidates:
    """Candidates: a frame displaced by any tangent (a point by any shift), scaled by a share in each of `samples`.

    Args:
        code: Code of the b candidates.
        views: The views.
        name: Name of the transform.
        shares: Share of the displacement in each sample, (samples, b).
        first_samples: For each candidate, the first affected sample; None if all samples are affected.
    """

    def moves(k: int) -> Array | None:
        """Moves of a group, (n, b, 6, q); None if it does not depend on the frame."""
        if not views.depends(k, name):
            return None
        by_frame = views.frame_jacobian(k, name)[..., : 3 if name in views.point_mounts else 6]
        return np.asarray(shares[views.sample_indices(views.groups[k])][..., None, None] * by_frame[:, None])

    return Candidates(
        code, (name,) * len(first_samples), first_samples, "", tuple(map(moves, range(len(views.groups))))
    )


def elapsed_share(views: Views) -> Array:
    """Elapsed share of the time from the first sample to the last, at each of `samples`, 0 to 1."""
    return np.asarray((views.times - views.times[0]) / max(views.times[-1] - views.times[0], 1e-300))
