"""Views of one target by one camera, and the two ends of their kinematic loop."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.estimation.view.measurement import Measurement, Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, IntArray, Rows
from basecal.geometry.rotation import lengths
from basecal.numerics.batch import SHARED, take


@dataclass(frozen=True, eq=False)
class End:
    """One end of the loop: a camera or target, and the robot or world that carries it.

    Attributes:
        robot: Name of the robot; None on `world`, and on a plate in the world.
        mount: Name of the transform of the camera or target.
        base: Name of the transform of the robot's base, or of the plate; None for the reference, and on `world`.
        base_from_flange: (n,) recorded poses; identity on `world`.
        stop: (n,) rows of the stops' errors; -1 if the robot's noise is not stated.
        stop_number: (n,) number of the stop among all stops of the robot, with or without stated noise; -1 on `world`.
        joints: (n, joints) recorded joints [rad]; None if poses are recorded.
        passed_s: (n,) times of views during motion [s], NaN for views at rest; None if the robot never moved.
    """

    robot: str | None
    mount: str
    base: str | None
    base_from_flange: SE3
    stop: IntArray
    stop_number: IntArray
    joints: Array | None = None
    passed_s: Array | None = None

    @classmethod
    def still(cls, mount: str, count: int, base: str | None = None) -> End:
        """Make the end of a camera or target on `world`, or on a plate, for `count` views."""
        no_stop = np.full(count, -1, dtype=np.int64)
        return cls(None, mount, base, SE3.identity((count,)), no_stop, no_stop)

    @cached_property
    def flange_from_base(self) -> SE3:
        """Inverses of the recorded poses, (n,)."""
        return self.base_from_flange.inverse()

    @cached_property
    def has_noise(self) -> bool:
        """Whether the poses of the robot have stated noise."""
        return bool(self.stop.size and self.stop.flat[0] >= 0)

    def world_from_base(self, transforms: Mapping[str, SE3]) -> SE3:
        """Pose of the robot's base, or of the plate, in the world; identity for the reference."""
        return SE3.identity() if self.base is None else transforms[self.base]


@dataclass(frozen=True, eq=False)
class ViewGroup:
    """All views of one target by one camera, with one kind of measurement.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        ends: Ends of the camera and of the target; see `eye` and `hand`.
        sample: (n,) sample numbers. This and all other arrays have a leading batch axis, (b, n), if each entry of a
            batch has views of its own. In this case no stop has noise.
        measurement: Measurements of the views.
        readings: Alternative readings of ambiguous views; see `problem.measurements.alternative_readings`.
        half_turn: `target_from_turned` if the target looks the same rotated by 180 deg; else None.
        motion: (n, 6) velocity of `camera_from_target` in the target's axes [m/s, rad/s]; None if nothing moves.
    """

    camera: str
    target: str
    ends: tuple[End, End]
    sample: IntArray
    measurement: Measurement
    readings: tuple[PixelMeasurement, ...] = ()
    half_turn: SE3 | None = field(default=None, metadata=SHARED)
    motion: Array | None = None

    def __len__(self) -> int:
        return int(self.sample.shape[-1])

    @property
    def eye(self) -> End:
        """End of the camera."""
        return self.ends[0]

    @property
    def hand(self) -> End:
        """End of the target."""
        return self.ends[1]

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots at the ends."""
        return tuple(end.robot for end in self.ends if end.robot is not None)

    @cached_property
    def reach_m(self) -> float:
        """Median distance of the flange from its base, of the arm with the longer reach [m]; 1 without robots."""
        reaches = [lengths(end.base_from_flange.translation) for end in self.ends if end.robot is not None]
        return max((float(np.median(reach)) for reach in reaches if reach.size), default=1.0)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the transforms that the views depend on: mounts and bases."""
        return tuple(name for end in self.ends for name in (end.mount, end.base) if name is not None)

    def robot_end(self, robot: str) -> End | None:
        """End of a robot; None if the robot carries neither camera nor target."""
        return next((end for end in self.ends if end.robot == robot), None)

    def with_ends(self, change: Callable[[End], End]) -> ViewGroup:
        """Return a copy with `change` applied to both ends."""
        eye, hand = self.ends
        return replace(self, ends=(change(eye), change(hand)))

    def without_stops(self) -> ViewGroup:
        """Return a copy in which robots are assumed exact."""
        none = np.full(len(self), -1, dtype=np.int64)
        return self.with_ends(lambda end: replace(end, stop=none))

    def eye_base_from_hand_base(self, transforms: Mapping[str, SE3]) -> SE3:
        """Pose of the hand's base in the eye's base, from the transforms of both."""
        world_from_eye_base, world_from_hand_base = (end.world_from_base(transforms) for end in self.ends)
        return world_from_eye_base.inverse() @ world_from_hand_base

    def placed_base(
        self, eye_base_from_hand_base: SE3, transforms: Mapping[str, SE3], free: Container[str | None]
    ) -> dict[str, SE3]:
        """Transform of the free base, by name, that satisfies a relation of the bases.

        Args:
            eye_base_from_hand_base: Relation of the bases.
            transforms: Transforms by name; they determine the other base.
            free: Names of the free transforms.

        Returns:
            The hand's base if it is free, else the eye's base if it is free, else nothing.
        """
        eye, hand = (end.base for end in self.ends)
        if hand is not None and hand in free:
            return {hand: transforms[eye] @ eye_base_from_hand_base if eye else eye_base_from_hand_base}
        if eye is not None and eye in free:
            hand_base_from_eye_base = eye_base_from_hand_base.inverse()
            return {eye: transforms[hand] @ hand_base_from_eye_base if hand else hand_base_from_eye_base}
        return {}

    def close_loop(
        self, eye_flange_from_camera: SE3, eye_base_from_hand_base: SE3, hand_flange_from_target: SE3
    ) -> SE3:
        """`camera_from_target` from the recorded poses, the mounts and the relation of the bases, (n,)."""
        eye_base_from_eye_flange, hand_base_from_hand_flange = (end.base_from_flange for end in self.ends)
        camera_from_eye_base = (eye_base_from_eye_flange @ eye_flange_from_camera).inverse()
        return camera_from_eye_base @ eye_base_from_hand_base @ hand_base_from_hand_flange @ hand_flange_from_target

    def take(self, views: Rows) -> ViewGroup:
        """Select views by index."""
        return take(self, views)

    def take_batch(self, rows: Rows) -> ViewGroup:
        """Select entries of a batch; views without a batch axis are shared."""
        if self.sample.ndim == 1:
            return replace(self, measurement=self.measurement.take_batch(rows))
        return self.take(rows)

    def with_noise(self, noise: Noise) -> ViewGroup:
        """Return a copy with sigmas for unstated noise."""
        readings = tuple(r.with_noise(noise) for r in self.readings)
        return replace(self, measurement=self.measurement.with_noise(noise), readings=readings)
