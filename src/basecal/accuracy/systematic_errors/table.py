"""The systematic errors that are looked for: a new one is a function, a line of `TABLE`, and words in the findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from basecal.accuracy.systematic_errors.candidates import Candidates
from basecal.accuracy.systematic_errors.situation import Situation, frames_of
from basecal.estimation.problem.build import recorded_by_joints
from basecal.geometry import Array
from basecal.geometry.rotation import hat
from basecal.kinematics.chain import SerialChain
from basecal.kinematics.gravity import gravity_torques

_MOST_SPLITS = 32  # of a recording in time: where a step is looked for
_LEAST_SIDE = 3  # samples before and after a step
PER_NM = "rad/Nm"  # unit of a compliance
OFFSETS = "joint_offsets"  # the kind of robot parameters
_FEWEST_IN_TIME = 6  # samples that may drift

_Moves = tuple[Array | None, ...]


def length_scales(of: Situation) -> Iterator[Candidates]:
    """Each robot's poses too short; with two robots and more the target's, too large, by a fraction."""
    for robot in of.robots:
        yield _one("length-scale", robot, "", _carrying(of, robot, _shorter))
    if len(of.robots) < 2:
        return  # a robot too short is then all else too long
    for target in sorted({g.target for g in of.problem.groups if g.target_mount not in of.problem.point_mounts}):
        seen = (larger(of, k) if g.target == target else None for k, g in enumerate(of.problem.groups))
        yield _one("length-scale", target, "", tuple(seen))


def _shorter(of: Situation, k: int, robot: str) -> Array:
    pose = of.recorded_pose(k, robot)
    outward = np.zeros((len(of.problem.groups[k]), 6, 1))
    outward[:, :3] = pose.rotation.mT @ pose.translation[..., None]
    return of.by_flange(k, robot) @ outward


def larger(of: Situation, k: int) -> Array:
    """How views of a group move with the size of their target by a fraction, (n, 6, 1).

    A target that is larger than stated is seen nearer than it stands, since its image is larger.
    """
    nearer = np.zeros((len(of.problem.groups[k]), 6, 1))
    nearer[:, :3] = of.links[k].target_from_camera.translation[..., None]
    return nearer


def clock_offsets(of: Situation) -> Iterator[Candidates]:
    """Clocks of each camera against all robots, and of each robot against the others, where arms move along paths.

    Those that are estimated, and move the answer at its end, are none.
    """
    for name, late in ((n, late) for n, late in _late(of) if n not in of.recorded.open_clocks):
        yield _one("clock-offset", name, "s" if of.timed else "samples", late)


def clock_drifts(of: Situation) -> Iterator[Candidates]:
    """The same clocks, each by so much more at the last sample than at the first, and right in the middle."""
    if not of.timed or len(of.samples) < _FEWEST_IN_TIME:
        return
    share = _share(of) - 0.5
    for name, late in _late(of):
        moves = tuple(
            None if m is None else share[of.rank(g)][:, None, None] * m
            for m, g in zip(late, of.problem.groups, strict=True)
        )
        yield _one("clock-drift", name, "s", moves)


def _late(of: Situation) -> Iterator[tuple[str, _Moves]]:
    """How views move by the unit of time that poses are read later, by the camera or robot whose clock says so."""
    velocity = {robot: of.velocity(robot) for robot in of.robots}
    paths = {robot: v for robot, v in velocity.items() if v is not None}
    if not paths:
        return
    groups = of.problem.groups

    def moved(of: Situation, k: int, robot: str) -> Array:
        """How views of a group move by the unit of time of a robot, (n, 6, 1)."""
        return of.by_flange(k, robot) @ paths[robot][of.rank(groups[k])][..., None]

    for camera in sorted({g.camera for g in groups}):
        arms = [[r for r in {g.eye, g.hand} & paths.keys() if r] if g.camera == camera else [] for g in groups]
        if any(arms):
            late = ([moved(of, k, r) for r in both] for k, both in enumerate(arms))
            yield camera, tuple(np.sum(each, axis=0) if each else None for each in late)
    for robot in paths if len(paths) > 1 else ():
        yield robot, _carrying(of, robot, moved)


def steps(of: Situation) -> Iterator[Candidates]:
    """Each base and mount moved at one of the samples, by any tangent."""
    count = len(of.samples)
    splits = np.arange(_LEAST_SIDE, count - _LEAST_SIDE + 1)
    splits = splits[np.unique(np.linspace(0, len(splits) - 1, min(_MOST_SPLITS, len(splits))).astype(int))]
    if not len(splits):
        return
    since = tuple(int(of.samples[s]) for s in splits)
    for name in of.frames:
        after = (
            (of.rank(g)[:, None] >= splits)[..., None, None] * of.by_frame(k, name)[:, None]
            if name in frames_of(g)
            else None
            for k, g in enumerate(of.problem.groups)
        )
        yield Candidates("base-moved", (name,) * len(splits), since, "", tuple(after))


def drifts(of: Situation) -> Iterator[Candidates]:
    """Each base and mount moved steadily, by a tangent from the first sample to the last."""
    if len(of.samples) < _FEWEST_IN_TIME:
        return
    share = _share(of)
    for name in of.frames:
        moves = (
            share[of.rank(g)][:, None, None] * of.by_frame(k, name) if name in frames_of(g) else None
            for k, g in enumerate(of.problem.groups)
        )
        yield _one("drift", name, "", tuple(moves))


def sag(of: Situation) -> Iterator[Candidates]:
    """Each robot bent about its base by what hangs out: a turn of reach x down [rad per m].

    Most of it is a tilt of the base, so that little is left to tell where down is: along the axis of the base, as of
    arms that stand or hang, or anywhere.
    """
    for robot in of.robots:
        moves = _carrying(of, robot, _bent)
        yield _one("deflection", robot, "rad/m", tuple(None if each is None else each[..., 2:] for each in moves))
        yield _one("deflection", robot, "rad/m", moves)


def _bent(of: Situation, k: int, robot: str) -> Array:
    pose = of.recorded_pose(k, robot)
    turns = np.zeros((len(pose), 6, 3))
    turns[:, 3:] = hat(pose.translation)
    return of.by_flange(k, robot) @ pose.inverse().adjoint() @ turns


def yielding_joints(of: Situation) -> Iterator[Candidates]:
    """Each robot whose joints and masses are known yielding to the weight of its links: a turn of compliance x torque.

    Of one compliance for all its joints, and of one for each [rad/Nm].
    """
    for robot in of.robots:
        chain, model = of.problem.chains.get(robot), of.problem.modelled(robot)
        estimated = model is not None and "deflection" in model.columns
        if chain is None or chain.masses is None or estimated or not recorded_by_joints(of.problem, robot):
            continue
        each = _carrying(of, robot, partial(_yielding, chain=chain))
        yield _one("deflection", robot, PER_NM, tuple(None if m is None else m.sum(-1, keepdims=True) for m in each))
        yield _one("deflection", robot, PER_NM, each)


def _yielding(of: Situation, k: int, robot: str, chain: SerialChain) -> Array:
    """How views move with the compliance of each joint of a robot, (n, 6, joints)."""
    group = of.problem.groups[k]
    joints = group.eye_joints if group.eye == robot else group.hand_joints
    if joints is None:
        return np.zeros((len(group), 6, chain.n))
    torques = gravity_torques(chain, joints)
    return of.by_flange(k, robot) @ (chain.jacobian(joints) * torques[:, None, :])


def joint_offsets(of: Situation) -> Iterator[Candidates]:
    """Each joint of each robot given by its joints off by a constant [rad], where its offsets are not estimated.

    Then all joints of a robot at once: of many that are off, none alone explains much.
    """
    for robot in of.robots:
        chain, model = of.problem.chains.get(robot), of.problem.modelled(robot)
        estimated = model is not None and OFFSETS in model.columns
        if chain is None or estimated or not recorded_by_joints(of.problem, robot):
            continue
        moves = _carrying(of, robot, partial(_turned, chain=chain))
        every = tuple(range(chain.n))
        yield Candidates("joint-offset", (robot,) * chain.n, (None,) * chain.n, "rad", moves, every)
        together = (None if m is None else np.moveaxis(m, 1, 3)[..., 0, :] for m in moves)
        yield _one("joint-offsets", robot, "rad", tuple(together))


def _turned(of: Situation, k: int, robot: str, chain: SerialChain) -> Array:
    """How views move with each joint of a robot, (n, joints, 6, 1)."""
    group = of.problem.groups[k]
    joints = group.eye_joints if group.eye == robot else group.hand_joints
    by_joints = np.zeros((len(group), 6, chain.n)) if joints is None else chain.jacobian(joints)
    return np.swapaxes(of.by_flange(k, robot) @ by_joints, -1, -2)[..., None]


def _carrying(of: Situation, robot: str, move: Callable[[Situation, int, str], Array]) -> _Moves:
    """Moves of the groups whose camera or target a robot carries; None of the others."""
    return tuple(move(of, k, robot) if robot in (g.eye, g.hand) else None for k, g in enumerate(of.problem.groups))


def _share(of: Situation) -> Array:
    """Of the time from the first sample to the last, what has passed at each, 0 to 1."""
    return np.asarray((of.times - of.times[0]) / max(of.times[-1] - of.times[0], 1e-300))


def _one(code: str, about: str, unit: str, moves: _Moves) -> Candidates:
    return Candidates(code, (about,), (None,), unit, tuple(None if m is None else m[:, None] for m in moves))


TABLE: tuple[Callable[[Situation], Iterator[Candidates]], ...] = (
    length_scales,
    clock_offsets,
    clock_drifts,
    steps,
    drifts,
    sag,
    yielding_joints,
    joint_offsets,
)
