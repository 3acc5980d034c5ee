"""The views of a solved problem as effects see them, and candidates of a score test: how views move with effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.kinematics import SerialChain

Moves = tuple[Array | None, ...]
"""By group of views, (n, 6, q) right tangents of `camera_from_target` by unit sizes; None for a group that is still."""


class End(Protocol):
    """One end of n views: the camera or the target that a robot carries."""

    @property
    def mount(self) -> str:
        """Name of the transform of what it carries."""

    @property
    def joints(self) -> Array | None:
        """(n, joints) of the robot as recorded [rad]."""


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
        """(n,) numbers of the samples."""

    @property
    def eye(self) -> End:
        """The end of the camera."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the transforms that the views depend on: mounts and bases."""

    def robot_end(self, robot: str) -> End | None:
        """The end that a robot carries; None if it carries neither camera nor target."""

    def __len__(self) -> int:
        """How many views there are."""


class Views(Protocol):
    """All views, by group; derivatives are right tangents of `camera_from_target`."""

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
        """Kinematics as stated, by robot that was recorded by joints."""

    @property
    def estimated_effects(self) -> Mapping[str, frozenset[str]]:
        """Names of the effects that are estimated as unknowns, by robot, camera or target."""

    @property
    def samples(self) -> IntArray:
        """Numbers of all recorded samples in their order in time."""

    @property
    def times(self) -> Array:
        """Times of `samples` [s], or their order if `timed` is false."""

    @property
    def has_times(self) -> bool:
        """Whether all samples have a time, and not all the same."""

    @property
    def mounts(self) -> Mapping[str, str]:
        """Robots that were recorded at more than one pose, by the names of the mounts that they carry."""

    def down_in_flange(self, k: int, robot: str) -> Array:
        """Direction of gravity in a robot's flange, which carries something in the views of a group, (n, 3)."""

    def transform(self, name: str) -> SE3:
        """A mount or a base."""

    def rank(self, group: Group) -> IntArray:
        """Indices of the samples of a group's views in `samples`, (n,)."""

    def flange_jacobian(self, k: int, robot: str) -> Array:
        """How views of a group move with a right tangent of a robot's flange, (n, 6, 6)."""

    def depends(self, k: int, name: str) -> bool:
        """Whether views of a group depend on a transform."""

    def frame_jacobian(self, k: int, name: str) -> Array:
        """How views of a group move with a right tangent of a transform, (n, 6, 6)."""

    def target_from_camera(self, k: int) -> SE3:
        """Poses of the camera in the target, of the views of a group, (n,)."""

    def recorded_pose(self, k: int, robot: str) -> SE3:
        """Poses of a robot's flange in a group's views, (n,); identity if it carries nothing there."""

    def velocity(self, robot: str) -> Array | None:
        """Body velocity of a robot at each of `samples`, (n, 6) by unit of `times`; None off a path."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Effects of one kind that may be in the data, each with as many sizes.

    Attributes:
        code: Kind of candidate, such as `joint-offset`; the words of its effect go by it.
        about: Of each, the robot, camera, target or transform that has it.
        since: Of each, the number of the first sample that has it; None if all samples do.
        unit: Unit of the sizes.
        moves: By group of views, (n, b, 6, q) right tangents of `camera_from_target` by unit sizes of b candidates. It
            is None for a group that no candidate moves.
        joint: Of each, the number of the joint that has it, from 0; empty if none has one.
    """

    code: str
    about: tuple[str, ...]
    since: tuple[int | None, ...]
    unit: str
    moves: tuple[Array | None, ...]
    joint: tuple[int, ...] = ()

    @property
    def sizes(self) -> int:
        """How many sizes each has."""
        return int(next(m.shape[-1] for m in self.moves if m is not None))

    def single(self, index: int) -> Candidates:
        """One of them."""
        moves = tuple(None if m is None else m[:, index : index + 1].copy() for m in self.moves)
        joint = self.joint[index : index + 1]
        return Candidates(self.code, (self.about[index],), (self.since[index],), self.unit, moves, joint)

    def join_sizes(self) -> Candidates:
        """All of them as one, which has the sizes of all."""
        moves = (None if m is None else np.moveaxis(m, 1, 2).reshape(len(m), 1, 6, -1) for m in self.moves)
        return Candidates(self.code, self.about[:1], self.since[:1], self.unit, tuple(moves))


def one_candidate(code: str, subject: str, unit: str, moves: tuple[Array | None, ...]) -> Candidates:
    """A candidate alone, whose moves are (n, 6, q) by group."""
    return Candidates(code, (subject,), (None,), unit, tuple(None if m is None else m[:, None] for m in moves))


def combine_candidates(candidates: Sequence[Candidates], views: Views) -> Candidates:
    """Candidates, each alone of its kind, as one that has the sizes of all."""

    def moves(k: int) -> Array:
        """Moves of a group by all sizes, (n, 1, 6, q)."""
        still = np.zeros((len(views.groups[k]), 1, 6, 0))
        parts = [(np.zeros((*still.shape[:3], each.sizes)), each.moves[k]) for each in candidates]
        return np.concatenate([still, *(none if own is None else own for none, own in parts)], axis=-1)

    return Candidates("", ("",), (None,), "", tuple(map(moves, range(len(views.groups)))))


def robot_moves(views: Views, robot: str, move: Callable[[Views, int, str], Array]) -> Moves:
    """Moves of the groups whose camera or target a robot carries."""
    return tuple(move(views, k, robot) if g.robot_end(robot) else None for k, g in enumerate(views.groups))


def pose_moves(views: Views, robot: str, tangents: Callable[[SE3], Array]) -> Moves:
    """Moves by tangents of a robot's flange, (n, 6, q), at its recorded poses, (n,)."""

    def moves(views: Views, k: int, robot: str) -> Array:
        """Moves of a group."""
        return np.asarray(views.flange_jacobian(k, robot) @ tangents(views.recorded_pose(k, robot)))

    return robot_moves(views, robot, moves)


def mount_moves(views: Views, mount: str, move: Callable[[Array], Array]) -> Moves:
    """Moves of the groups that depend on a mount, by what gravity does to it.

    A mount that is not fixed is its pose under the mean of gravity in the recorded poses. An effect that is equal in
    all of them adds no uncertainty to it.

    Args:
        views: The views.
        mount: A mount on a robot.
        move: Linear: tangents of the flange, (n, 6, q), by the direction of gravity there, (n, 3).
    """
    robot = views.mounts[mount]
    downs = {k: views.down_in_flange(k, robot) for k, g in enumerate(views.groups) if mount in g.frames}
    about = 0.0 if mount in views.fixed_frames else np.concatenate(list(downs.values())).mean(0)
    return tuple(
        views.flange_jacobian(k, robot) @ move(downs[k] - about) if k in downs else None
        for k in range(len(views.groups))
    )


def frame_candidates(
    code: str, views: Views, name: str, shares: Array | BoolArray, first_samples: tuple[int | None, ...] = (None,)
) -> Candidates:
    """A frame that is elsewhere by any tangent, or any shift of a point, times its share in each of `samples`.

    Args:
        code: Of the candidates, b of them.
        views: The views.
        name: Of the transform.
        shares: (samples, b).
        first_samples: The first sample of each that has it; None if all samples do.
    """

    def moves(k: int) -> Array | None:
        """How views of a group move, (n, b, 6, q)."""
        if not views.depends(k, name):
            return None
        by_frame = views.frame_jacobian(k, name)[..., : 3 if name in views.point_mounts else 6]
        return np.asarray(shares[views.rank(views.groups[k])][..., None, None] * by_frame[:, None])

    return Candidates(
        code, (name,) * len(first_samples), first_samples, "", tuple(map(moves, range(len(views.groups))))
    )


def elapsed_share(views: Views) -> Array:
    """Share of the time from the first sample to the last that has passed at each of `samples`, 0 to 1."""
    return np.asarray((views.times - views.times[0]) / max(views.times[-1] - views.times[0], 1e-300))
