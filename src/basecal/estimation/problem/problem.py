"""A cell and a recording as arrays: the views, the unknowns and their columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from basecal.cell import Cell, Intrinsics, Unknown
from basecal.errors import InputError
from basecal.estimation.problem.robot_parameters import Kinematics, RobotModel
from basecal.estimation.problem.tied_views import SCENE, TiedViews
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.kinematics import SerialChain


@dataclass(frozen=True, eq=False)
class Stops:
    """Stops of the robots: each stop has one pose error `sigma * u`, with u ~ N(0, I).

    Attributes:
        sigma: (k, 6) [m, rad] in flange axes.
        robot: (k,) the robot's name.
    """

    sigma: Array
    robot: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.sigma)

    @cached_property
    def first(self) -> dict[str, int]:
        """Row of each robot's first stop."""
        return {name: k for k, name in reversed(list(enumerate(self.robot)))}

    def robot_mask(self, robots: Iterable[str]) -> BoolArray:
        """Mask of the stops of some robots, (k,)."""
        chosen = frozenset(robots)
        return np.array([name in chosen for name in self.robot], dtype=bool)


@dataclass(frozen=True, eq=False)
class Problem:
    """Input of the solver: views, unknowns and their columns.

    Attributes:
        reference: The robot whose base is `world`.
        groups: The views.
        unknowns: Every transform of the cell by name.
        point_mounts: Names of the mounts of single points, which have three columns.
        lenses: Stated intrinsics of cameras with pixels, by camera.
        stops: The robots' stops.
        columns: Slice of each unknown in the step vector, without fixed unknowns. The keys are names of transforms and
            cameras, and `<robot>_<kind>` for the parameters of a robot.
        models: Estimated parameters of the robots' kinematics, by robot.
        chains: Stated kinematics, by robot, of the robots that have any.
        unstated: Names of the robots without stated noise.
        stop_counts: Number of stops of each robot, by robot, including stops without views.
        held: Whether unstated sigmas are held at their present values.
        exact_targets: Names of the targets whose stated shape is exact.
        shapes: Estimated shapes of targets, by name; see `effects.target_shape`.
        jitter_s: Sigma in use of the timing jitter of single stamps, by camera [s].
        open_jitter: Cameras whose jitter is to be estimated.
        open_clocks: Devices whose clock offsets are estimated about the solution.
        tied: Views of the static scene, in addition to those of targets; None if there are none.
        gauges: Held directions of free transforms, on which no view depends, (6,) of 1 or 0 by name.
    """

    reference: str
    groups: tuple[ViewGroup, ...]
    unknowns: Mapping[str, Unknown]
    point_mounts: frozenset[str]
    lenses: Mapping[str, Intrinsics]
    stops: Stops
    columns: Mapping[str, slice]
    unstated: frozenset[str] = frozenset()
    models: Mapping[str, RobotModel] = field(default_factory=dict)
    chains: Mapping[str, SerialChain] = field(default_factory=dict)
    stop_counts: Mapping[str, int] = field(default_factory=dict)
    held: bool = False
    exact_targets: frozenset[str] = frozenset()
    shapes: Mapping[str, Array] = field(default_factory=dict)
    jitter_s: Mapping[str, float] = field(default_factory=dict)
    open_jitter: frozenset[str] = frozenset()
    open_clocks: frozenset[str] = frozenset()
    tied: TiedViews | None = None
    gauges: Mapping[str, Array] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """Number of columns."""
        return max((c.stop for c in self.columns.values()), default=0)

    @property
    def equation_count(self) -> int:
        """Number of equations that the views of targets give, at most six each; see `Measurement.equations`."""
        return sum(int(group.measurement.equations().sum()) for group in self.groups)

    @property
    def samples(self) -> IntArray:
        """Numbers of the samples with views of targets, (m,), increasing."""
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(group.sample for group in self.groups)]))

    def column_width(self, name: str) -> int:
        """Number of columns of an unknown; 0 if it is fixed."""
        columns = self.columns.get(name)
        return 0 if columns is None else columns.stop - columns.start

    def fixed_factors(self, group: ViewGroup) -> tuple[SE3 | None, SE3 | None, SE3 | None]:
        """Fixed transforms X, Y and Z of a group's loop equation; None for each that is not fixed."""
        fixed = {None: SE3.identity()} | {
            name: unknown.mean for name, unknown in self.unknowns.items() if unknown.status == "fixed"
        }
        x, z = (fixed.get(end.mount) for end in group.ends)
        eye, hand = (fixed.get(end.base) for end in group.ends)
        return x, None if eye is None or hand is None else eye.inverse() @ hand, z

    def column_indices(self, names: Iterable[str]) -> IntArray:
        """Concatenated column indices of named unknowns."""
        slices = (self.columns[name] for name in names)
        return np.array([k for part in slices for k in range(part.start, part.stop)], dtype=np.int64)

    @property
    def all_groups(self) -> tuple[ViewGroup, ...]:
        """The views of targets, then those of the scene."""
        return self.groups if self.tied is None else (*self.groups, *self.tied.groups)

    @cached_property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots that carry a camera or target of the views."""
        return tuple(sorted({robot for group in self.all_groups for robot in group.robots}))

    def robot_ends(self, robot: str | None) -> list[End]:
        """Ends of views that belong to a robot, or to the world if `robot` is None."""
        ends = [end for group in self.all_groups for end in group.ends if end.mount != SCENE]
        return [end for end in ends if end.robot == robot]

    @cached_property
    def shared_stops(self) -> IntArray:
        """Index of each stop among the stops shared by several views, (k,); -1 for stops of a single view."""
        count = np.zeros(len(self.stops), dtype=np.int64)
        for group in self.groups if len(count) else ():
            for end in group.ends:
                count += np.bincount(end.stop[end.stop >= 0], minlength=len(count))
        is_shared = count > 1
        if self.tied is not None:
            is_shared[self.tied.stops] = True
        return np.where(is_shared, np.cumsum(is_shared) - 1, -1)

    def jitter_motion(self, group: ViewGroup) -> Array | None:
        """Motion of views during one sigma of timing jitter, (n, 6) [m, rad]; None without jitter or motion."""
        jitter_s = self.jitter_s.get(group.camera, 0.0)
        return group.motion * jitter_s if jitter_s and group.motion is not None else None

    def with_noise(self, noise: Noise) -> Problem:
        """Return a copy with new sigmas for unstated noise; the same problem if sigmas are held."""
        return self if self.held else self.with_groups(g.with_noise(noise) for g in self.groups)

    def with_groups(self, groups: Iterable[ViewGroup]) -> Problem:
        """Return a copy with the given groups of views."""
        return replace(self, groups=tuple(groups))

    def take_views(self, rows: Iterable[IntArray]) -> Problem:
        """Select views by their rows in each group; groups without any are removed."""
        return self.with_groups(g.take(r) for g, r in zip(self.groups, rows, strict=True) if len(r))

    def with_ends(self, change: Callable[[End], End]) -> Problem:
        """Return a copy with `change` applied to the ends of all views."""
        changed = self.with_groups(group.with_ends(change) for group in self.groups)
        if self.tied is None:
            return changed
        tied = tuple(group.with_ends(change) for group in self.tied.groups)
        return replace(changed, tied=replace(self.tied, groups=tied))

    def take_batch(self, rows: Rows) -> Problem:
        """Select entries of a batch of problems."""
        return self.with_groups(g.take_batch(rows) for g in self.groups)

    def robot_model(self, robot: str | None) -> RobotModel | None:
        """Kinematic model of a robot; None if it has no columns in the step."""
        model = self.models.get(robot or "")
        return model if model is not None and all(name in self.columns for name in model.widths) else None

    def with_models(self, models: Mapping[str, RobotModel]) -> Problem:
        """Return a copy with the given kinematic models; their columns follow all other columns."""
        replaced = {name for model in self.models.values() for name in model.widths}
        columns = {name: part for name, part in self.columns.items() if name not in replaced}
        first = max((c.stop for c in columns.values()), default=0)
        for model in models.values():
            for name, width in model.widths.items():
                columns[name] = slice(first, first + width)
                first += width
        return replace(self, columns=columns, models=models)


@dataclass(frozen=True, eq=False)
class State:
    """A value for every unknown, or a batch of values.

    Attributes:
        transforms: Transforms by name, (...).
        cameras: Lenses by camera, with parameters (..., k); one lens with parameters (k,) may serve a whole batch.
        stop_errors: (..., k, 6) pose errors in sigmas, one row per stop.
        robots: Kinematics of the robots that differ from the stated kinematics.
    """

    transforms: Mapping[str, SE3]
    cameras: Mapping[str, Camera]
    stop_errors: Array
    robots: Mapping[str, Kinematics] = field(default_factory=dict)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch; () for a single state."""
        return self.stop_errors.shape[:-2]

    def repeat(self, problem: Problem, count: int) -> State:
        """Repeat a single state `count` times as a batch; lenses that are not estimated are shared."""
        transforms = {name: transform.repeat(count) for name, transform in self.transforms.items()}
        cameras = dict(self.cameras)
        for name in cameras.keys() & problem.columns.keys():
            parameters = self.cameras[name].parameters
            cameras[name] = cameras[name].with_parameters(np.broadcast_to(parameters, (count, len(parameters))))
        errors = np.broadcast_to(self.stop_errors, (count, *self.stop_errors.shape))
        models = {name: model for name in problem.models if (model := problem.robot_model(name)) is not None}
        robots = {**self.robots, **{name: self.kinematics(model) for name, model in models.items()}}
        repeated = {name: kinematics.repeat(models.get(name), count) for name, kinematics in robots.items()}
        return State(transforms, cameras, errors, repeated)

    def view_transform(self, name: str) -> SE3:
        """A transform that broadcasts against views: (..., 1) for a batch."""
        if name == SCENE:
            return SE3.identity()
        transform = self.transforms[name]
        return transform.add_axis() if transform.shape else transform

    def kinematics(self, model: RobotModel) -> Kinematics:
        """Current kinematics of a robot; the stated kinematics if the state has none of its own."""
        return self.robots.get(model.robot) or Kinematics(model.chain, stated=model.stated)

    def camera_from_target(self, group: ViewGroup, stops: Stops) -> SE3:
        """Predicted poses of the target in the camera, (..., n)."""
        return chain(group, self, stops).camera_from_target


class Link(NamedTuple):
    """Frames at one end of the views' loop, relative to the target, (..., n) each.

    Attributes:
        sign: Sign of the views' motion: -1 at the camera's end, 1 at the target's end.
        target_from_base: Pose of the robot base in the target.
        target_from_flange: Pose of the flange in the target.
        target_from_carried: Pose of the camera in the target; None at the target's end.
    """

    sign: float
    target_from_base: SE3
    target_from_flange: SE3
    target_from_carried: SE3 | None


@dataclass(frozen=True, eq=False)
class Chain:
    """Factors of `camera_from_target`, one link per end of a group; see `chain`."""

    ends: tuple[Link, Link]
    target_from_camera: SE3

    @property
    def camera_from_target(self) -> SE3:
        """Predicted poses of the target in the camera, (..., n)."""
        return self.target_from_camera.inverse()

    def frames(self, group: ViewGroup) -> Iterator[tuple[str, float, SE3 | None]]:
        """Yield name, sign and `Link` pose of each transform that the views depend on, from camera to target."""
        (eye, hand), (at_eye, at_hand) = group.ends, self.ends
        yield eye.mount, at_eye.sign, at_eye.target_from_carried
        for end, link in zip(group.ends, self.ends, strict=True):
            if end.base is not None:
                yield end.base, link.sign, link.target_from_base
        yield hand.mount, at_hand.sign, at_hand.target_from_carried


def chain(group: ViewGroup, state: State, stops: Stops) -> Chain:
    """Evaluate the loop equation of a group, from the target back to the camera.

    camera_from_target == (eye_base_from_eye_flange @ eye_flange_from_camera).inverse()
                          @ eye_base_from_hand_base @ hand_base_from_hand_flange @ hand_flange_from_target
    """
    eye, hand = group.ends
    eye_error, hand_error = _flange_errors(group, state, stops)
    target_from_hand_flange = state.view_transform(hand.mount).inverse()
    target_from_hand_base = target_from_hand_flange @ _inverse_flange(hand, state, hand_error)
    target_from_eye_base = _to_eye_base(target_from_hand_base, group, state)
    target_from_eye_flange = target_from_eye_base @ _flange(eye, state, eye_error)
    target_from_camera = target_from_eye_flange @ state.view_transform(eye.mount)
    ends = (
        Link(-1.0, target_from_eye_base, target_from_eye_flange, target_from_camera),
        Link(1.0, target_from_hand_base, target_from_hand_flange, None),
    )
    return Chain(ends, target_from_camera)


def _to_eye_base(target_from_hand_base: SE3, group: ViewGroup, state: State) -> SE3:
    """`target_from_eye_base`; a base without a name is the reference base, which is the world."""
    eye, hand = group.ends
    if hand.base is None:
        return target_from_hand_base if eye.base is None else target_from_hand_base @ state.view_transform(eye.base)
    hand_base_from_world = state.view_transform(hand.base).inverse()
    if eye.base is None:
        return target_from_hand_base @ hand_base_from_world
    return target_from_hand_base @ (hand_base_from_world @ state.view_transform(eye.base))


def _flange(end: End, state: State, error: SE3 | None) -> SE3:
    """`base_from_flange` with its pose error: from estimated kinematics if the state has any, else as recorded."""
    kinematics = state.robots.get(end.robot or "")
    base_from_flange = end.base_from_flange
    if kinematics is not None and end.joints is not None:
        base_from_flange = kinematics.forward(end.joints)
    return base_from_flange if error is None else base_from_flange @ error


def _inverse_flange(end: End, state: State, error: SE3 | None) -> SE3:
    """Inverse of `_flange`; the cached inverse for recorded poses without error."""
    is_recorded = error is None and end.robot not in state.robots
    return end.flange_from_base if is_recorded else _flange(end, state, error).inverse()


def stop_tangents(group: ViewGroup, state: State, stops: Stops) -> Array:
    """Pose errors of the views' stops, those of the eye before those of the hand, (..., n or 2 n, 6) [m, rad].

    Robots without noise are left out. One array for both robots halves the number of calls, which dominate the cost.
    """
    stop = np.concatenate([end.stop for end in group.ends if end.has_noise])
    tangents: Array = state.stop_errors[..., stop, :] * stops.sigma[stop]
    return tangents


def _flange_errors(group: ViewGroup, state: State, stops: Stops) -> tuple[SE3 | None, SE3 | None]:
    """Errors of the recorded flange poses of eye and hand, (..., n) each; None for a robot without noise."""
    eye, hand = group.ends
    if not (eye.has_noise or hand.has_noise):
        return None, None
    error, n = SE3.exp(stop_tangents(group, state, stops)), len(group)
    first = SE3.adopt(error.rotation[..., :n, :, :], error.translation[..., :n, :])
    second = SE3.adopt(error.rotation[..., -n:, :, :], error.translation[..., -n:, :])
    return first if eye.has_noise else None, second if hand.has_noise else None


def sequential_columns(widths: Mapping[str, int]) -> dict[str, slice]:
    """Assign consecutive columns to names, from the number of columns of each."""
    ends = np.cumsum([0, *widths.values()]).tolist()
    return {name: slice(*each) for name, each in zip(widths, pairwise(ends), strict=True)}


def check_carriers(cell: Cell, camera: str, target: str) -> None:
    """Check that a camera and its target are on different bodies.

    Raises:
        InputError: if both are on the same body.
    """
    carrier = cell.cameras[camera].on
    if carrier == cell.targets[target].on:
        carriers = {c.on for c in cell.cameras.values()} | {t.on for t in cell.targets.values()}
        unused = set(cell.robots) - carriers
        suggestion = f" (on: {unused.pop()}?)" if len(unused) == 1 else ""
        raise InputError(
            f"camera {camera!r} and target {target!r} are both on {carrier!r}: no robot moves one against the other. "
            f"Set the `on` of one of them to what carries it{suggestion}"
        )
