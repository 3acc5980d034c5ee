"""A cell and a recording as arrays: the views, the unknowns and their columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.cell import WORLD, Cell, Intrinsics, Unknown
from basecal.errors import InputError
from basecal.estimation.problem.robot_parameters import Kinematics, RobotModel
from basecal.estimation.view.measurement import Measurement, Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, Camera, IntArray, Rows
from basecal.kinematics import SerialChain
from basecal.numerics.batch import SHARED


@dataclass(frozen=True, eq=False)
class ViewGroup:
    """All views of one target by one camera, of one kind of measurement.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        eye: Robot that carries the camera; None on `world`.
        hand: Robot that carries the target; None on `world`.
        camera_mount: Name of the camera's mount.
        target_mount: Name of the target's mount.
        eye_base: Name of the base transform of `eye`; None where it is the reference or `world`.
        hand_base: Likewise of `hand`.
        sample: (n,) sample numbers. With this and all else below goes a leading batch axis, (b, n), where each entry
            of a batch has views of its own; then no stop has noise.
        eye_base_from_eye_flange: (n,) recorded poses; identity on `world`.
        hand_base_from_hand_flange: (n,) likewise.
        eye_stop: (n,) rows of the stops' errors; -1 where the robot's noise is not stated.
        hand_stop: (n,) likewise.
        eye_stand: (n,) number of the stop among all that `eye` made, noise or not; -1 on `world`.
        hand_stand: (n,) likewise.
        measurement: What was seen.
        readings: All that may have been seen, where views can be read in several ways; see `readings`.
        half_turn: `target_from_turned` where the target looks the same turned by half a turn.
        eye_joints: (n, joints) as recorded [rad]; None where poses are recorded.
        hand_joints: (n, joints) likewise.
        motion: (n, 6) velocity of `camera_from_target` in the target's axes [m/s, rad/s]; None where nothing moves.
    """

    camera: str
    target: str
    eye: str | None
    hand: str | None
    camera_mount: str
    target_mount: str
    eye_base: str | None
    hand_base: str | None
    sample: IntArray
    eye_base_from_eye_flange: SE3
    hand_base_from_hand_flange: SE3
    eye_stop: IntArray
    hand_stop: IntArray
    eye_stand: IntArray
    hand_stand: IntArray
    measurement: Measurement
    readings: tuple[PixelMeasurement, ...] = ()
    half_turn: SE3 | None = field(default=None, metadata=SHARED)
    eye_joints: Array | None = None
    hand_joints: Array | None = None
    motion: Array | None = None

    def __len__(self) -> int:
        return int(self.sample.shape[-1])

    @cached_property
    def hand_flange_from_hand_base(self) -> SE3:
        """(n,) inverses of the recorded poses."""
        return self.hand_base_from_hand_flange.inverse()

    def take(self, views: Rows) -> ViewGroup:
        """The views at these indices."""
        return replace(
            self,
            sample=self.sample[views],
            eye_base_from_eye_flange=self.eye_base_from_eye_flange[views],
            hand_base_from_hand_flange=self.hand_base_from_hand_flange[views],
            eye_stop=self.eye_stop[views],
            hand_stop=self.hand_stop[views],
            eye_stand=self.eye_stand[views],
            hand_stand=self.hand_stand[views],
            measurement=self.measurement.take(views),
            readings=tuple(r.take(views) for r in self.readings),
            eye_joints=None if self.eye_joints is None else self.eye_joints[views],
            hand_joints=None if self.hand_joints is None else self.hand_joints[views],
            motion=None if self.motion is None else self.motion[views],
        )

    def of_batch(self, rows: Rows) -> ViewGroup:
        """What these rows of a batch saw."""
        if self.sample.ndim == 1:
            return replace(self, measurement=self.measurement.of_batch(rows))
        return self.take(rows)

    def with_noise(self, noise: Noise) -> ViewGroup:
        """The same with sigmas for what states none."""
        readings = tuple(r.with_noise(noise) for r in self.readings)
        return replace(self, measurement=self.measurement.with_noise(noise), readings=readings)


@dataclass(frozen=True, eq=False)
class Stops:
    """Where robots stood: each stop has one pose error `sigma * u`, with u normal of unit variance.

    Attributes:
        sigma: (k, 6) [m, rad] in flange axes.
        robot: (k,) the robot's name.
    """

    sigma: Array
    robot: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.sigma)


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything the solver needs.

    Attributes:
        reference: The robot whose base is `world`.
        groups: The views.
        unknowns: Every transform of the cell by name.
        point_mounts: Names of the mounts of single points, which have three columns.
        lenses: What is known of the lenses of cameras with pixels, by camera.
        stops: The robots' stops.
        columns: Where each unknown that is not fixed stands in the step, by the transform's or the camera's name, or as
            `<robot>_<kind>` for the parameters of a robot.
        models: What is estimated of the robots' own kinematics, by robot.
        chains: Kinematics as stated of the robots that have some, by robot.
        unstated: Names of the robots that state no noise.
        stands: How many stops each robot made, by robot, whatever views are left of them.
        held: Whether sigmas that nobody stated are held at what they are.
        exact_targets: Names of the targets whose shape is as stated.
        shapes: How targets are shaped, by name, if that was estimated; see `effects.target_shape`.
        jitter_s: Sigma in use of what stamps of a camera's views are off by themselves, by camera [s].
        open_jitter: Cameras whose jitter is to be estimated.
        open_clocks: Devices whose offsets in time are estimated about the solution.
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
    stands: Mapping[str, int] = field(default_factory=dict)
    held: bool = False
    exact_targets: frozenset[str] = frozenset()
    shapes: Mapping[str, Array] = field(default_factory=dict)
    jitter_s: Mapping[str, float] = field(default_factory=dict)
    open_jitter: frozenset[str] = frozenset()
    open_clocks: frozenset[str] = frozenset()

    @property
    def width(self) -> int:
        """Number of columns."""
        return max((c.stop for c in self.columns.values()), default=0)

    @cached_property
    def shared_stops(self) -> IntArray:
        """Number of each stop among those that several views have; -1 for the others, (k,)."""
        count = np.zeros(len(self.stops), dtype=np.int64)
        for group in self.groups if len(count) else ():
            for stop in (group.eye_stop, group.hand_stop):
                count += np.bincount(stop[stop >= 0], minlength=len(count))
        several = count > 1
        return np.where(several, np.cumsum(several) - 1, -1)

    def shake(self, group: ViewGroup) -> Array | None:
        """What one sigma of their stamps' jitter moves views by, (n, 6) [m, rad]; None where there is none."""
        jitter_s = self.jitter_s.get(group.camera, 0.0)
        return group.motion * jitter_s if jitter_s and group.motion is not None else None

    def with_noise(self, noise: Noise) -> Problem:
        """The same with sigmas for what states none, unless these are held."""
        return self if self.held else self.with_groups(g.with_noise(noise) for g in self.groups)

    def with_groups(self, groups: Iterable[ViewGroup]) -> Problem:
        """The same unknowns with other views."""
        return replace(self, groups=tuple(groups))

    def of_batch(self, rows: Rows) -> Problem:
        """The problems at these rows of a batch."""
        return self.with_groups(g.of_batch(rows) for g in self.groups)

    def modelled(self, robot: str | None) -> RobotModel | None:
        """The model of a robot that has columns in the step; None where it has none."""
        model = self.models.get(robot or "")
        return model if model is not None and all(name in self.columns for name in model.widths) else None

    def with_models(self, models: Mapping[str, RobotModel]) -> Problem:
        """The same with other columns of the robots' kinematics, after all others."""
        replaced = {name for model in self.models.values() for name in model.widths}
        columns = {name: where for name, where in self.columns.items() if name not in replaced}
        at = max((c.stop for c in columns.values()), default=0)
        for model in models.values():
            for name, width in model.widths.items():
                columns[name] = slice(at, at + width)
                at += width
        return replace(self, columns=columns, models=models)


@dataclass(frozen=True, eq=False)
class State:
    """A value for every unknown, or a batch of them.

    Attributes:
        transforms: By name, (...).
        cameras: Lenses by camera, of parameters (..., k); one lens of parameters (k,) may serve a whole batch.
        stop_errors: (..., k, 6) in sigmas, one row a stop.
        robots: Kinematics of the robots where they are not as stated.
    """

    transforms: Mapping[str, SE3]
    cameras: Mapping[str, Camera]
    stop_errors: Array
    robots: Mapping[str, Kinematics] = field(default_factory=dict)

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the batch, () of a single state."""
        return self.stop_errors.shape[:-2]

    def spread(self, problem: Problem, count: int) -> State:
        """A single state, so many times; lenses that are not estimated serve all."""

        def many(transform: SE3) -> SE3:
            """One transform, so many times."""
            rotation = np.broadcast_to(transform.rotation, (count, 3, 3))
            return SE3.adopt(rotation, np.broadcast_to(transform.translation, (count, 3)))

        transforms = {name: many(transform) for name, transform in self.transforms.items()}
        cameras = dict(self.cameras)
        for name in cameras.keys() & problem.columns.keys():
            parameters = self.cameras[name].parameters
            cameras[name] = cameras[name].with_parameters(np.broadcast_to(parameters, (count, len(parameters))))
        errors = np.broadcast_to(self.stop_errors, (count, *self.stop_errors.shape))
        models = {name: model for name in problem.models if (model := problem.modelled(name)) is not None}
        robots = {**self.robots, **{name: self.kinematics(model) for name, model in models.items()}}
        spread = {name: kinematics.spread(models.get(name), count) for name, kinematics in robots.items()}
        return State(transforms, cameras, errors, spread)

    def beside_views(self, name: str) -> SE3:
        """A transform that broadcasts against views: of a batch (..., 1)."""
        transform = self.transforms[name]
        return transform.spread() if transform.shape else transform

    def kinematics(self, model: RobotModel) -> Kinematics:
        """Where a robot's kinematics are, as stated unless moved."""
        return self.robots.get(model.robot) or Kinematics(model.chain, stated=model.stated)

    def camera_from_target(self, group: ViewGroup, stops: Stops) -> SE3:
        """Predicted poses of the target in the camera, (..., n)."""
        return chain(group, self, stops).camera_from_target


@dataclass(frozen=True, eq=False)
class Chain:
    """The factors of `camera_from_target` from its right end on, (..., n) each; see `chain`."""

    target_from_hand_flange: SE3
    target_from_hand_base: SE3
    target_from_eye_base: SE3
    target_from_eye_flange: SE3
    target_from_camera: SE3

    @property
    def camera_from_target(self) -> SE3:
        """(..., n)."""
        return self.target_from_camera.inverse()


def chain(group: ViewGroup, state: State, stops: Stops) -> Chain:
    """The products of the one equation, read from the target back to the camera.

    camera_from_target == (eye_base_from_eye_flange @ eye_flange_from_camera).inverse()
                          @ eye_base_from_hand_base @ hand_base_from_hand_flange @ hand_flange_from_target
    """
    target_from_hand_flange = state.beside_views(group.target_mount).inverse()
    hand_flange_from_hand_base = group.hand_flange_from_hand_base
    eye_error, hand_error = _flange_errors(group, state, stops)
    if hand_error is not None or group.hand in state.robots:
        hand_flange = _modelled(group.hand, group.hand_joints, group.hand_base_from_hand_flange, state)
        hand_flange_from_hand_base = (hand_flange if hand_error is None else hand_flange @ hand_error).inverse()
    eye_flange = _modelled(group.eye, group.eye_joints, group.eye_base_from_eye_flange, state)
    eye_base_from_eye_flange = eye_flange if eye_error is None else eye_flange @ eye_error
    target_from_hand_base = target_from_hand_flange @ hand_flange_from_hand_base
    target_from_eye_base = _to_eye_base(target_from_hand_base, group, state)
    target_from_eye_flange = target_from_eye_base @ eye_base_from_eye_flange
    target_from_camera = target_from_eye_flange @ state.beside_views(group.camera_mount)
    return Chain(
        target_from_hand_flange, target_from_hand_base, target_from_eye_base, target_from_eye_flange, target_from_camera
    )


def _to_eye_base(target_from_hand_base: SE3, group: ViewGroup, state: State) -> SE3:
    """`target_from_eye_base`; either base is the reference's, and the world's, where it has no name."""
    if group.hand_base is None and group.eye_base is None:
        return target_from_hand_base
    if group.hand_base is None:
        return target_from_hand_base @ state.beside_views(group.eye_base or "")
    hand_base_from_world = state.beside_views(group.hand_base).inverse()
    if group.eye_base is None:
        return target_from_hand_base @ hand_base_from_world
    return target_from_hand_base @ (hand_base_from_world @ state.beside_views(group.eye_base))


def _modelled(robot: str | None, joints: Array | None, recorded: SE3, state: State) -> SE3:
    """Poses of a flange by the robot's kinematics as they are: the recorded ones where these are as stated."""
    kinematics = state.robots.get(robot or "")
    return recorded if kinematics is None or joints is None else kinematics.forward(joints)


def has_noise(stop: IntArray) -> bool:
    """Whether the robot of views at these stops, (n,), has noise: -1 stands for none."""
    return bool(stop.size and stop.flat[0] >= 0)


def noisy_stops(group: ViewGroup) -> tuple[IntArray, ...]:
    """The stops of views, (n,), of those of their robots that have noise: eye's first."""
    return tuple(stop for stop in (group.eye_stop, group.hand_stop) if has_noise(stop))


def stop_tangents(group: ViewGroup, state: State, stops: Stops) -> Array:
    """The errors of all `noisy_stops` of views, one robot's after the other's, (..., n or 2 n, 6) [m, rad].

    Side by side they take half as many calls, which is what they cost.
    """
    stop = np.concatenate(noisy_stops(group))
    tangents: Array = state.stop_errors[..., stop, :] * stops.sigma[stop]
    return tangents


def _flange_errors(group: ViewGroup, state: State, stops: Stops) -> tuple[SE3 | None, SE3 | None]:
    """What eye's and hand's true flanges are off the recorded ones, (..., n) each; None without noise."""
    has = has_noise(group.eye_stop), has_noise(group.hand_stop)
    if not any(has):
        return None, None
    error, n = SE3.exp(stop_tangents(group, state, stops)), len(group)
    first = SE3.adopt(error.rotation[..., :n, :, :], error.translation[..., :n, :])
    second = SE3.adopt(error.rotation[..., -n:, :, :], error.translation[..., -n:, :])
    return first if has[0] else None, second if has[1] else None


def carrier(cell: Cell, on: str) -> str | None:
    """The robot that carries something; None on `world`."""
    return None if on == WORLD else on


def check_carriers(cell: Cell, camera: str, target: str) -> None:
    """Raise where a camera and its target hang on the same body.

    Raises:
        InputError: if they do.
    """
    on = cell.cameras[camera].on
    if on == cell.targets[target].on:
        carriers = {c.on for c in cell.cameras.values()} | {t.on for t in cell.targets.values()}
        idle = set(cell.robots) - carriers
        right = f" (on: {idle.pop()}?)" if len(idle) == 1 else ""
        raise InputError(
            f"camera {camera!r} and target {target!r} are both on {on!r}: no robot moves one against the other; "
            f"set the `on` of one of them to what carries it{right}"
        )
