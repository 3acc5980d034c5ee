"""A running cell: its arms, cameras and LED at any time."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from basecal.cell import WORLD, CellTarget, Target
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.simulation.running.arm import RunningArm, seeded_generator
from basecal.simulation.running.images import CameraScene, CameraView
from basecal.simulation.running.world import World
from basecal.simulation.surroundings.drawing import BodyPoses, Surroundings
from basecal.simulation.surroundings.model import Stage
from basecal.vision.detection import Image

_STATE_PERIOD_S = 1 / 125  # between states of an arm
_FRAME_PERIOD_S = 1 / 30  # between images of a camera
_EXPOSURE_S = 0.008
_TRAY_DEPTH_M = 0.12  # depth of the reflecting tray below the LED's initial position


@dataclass(frozen=True, eq=False)
class Shot:
    """An image, (h, w), with the camera's timestamp [s]."""

    stamp_s: float
    image: Image


class Plant:
    """A running cell; not thread-safe.

    With `surroundings`, MuJoCo renders the surroundings of the target.
    """

    def __init__(self, world: World, clock: Clock, surroundings: bool = False) -> None:
        if not world.cell.targets:
            raise InputError("the cell has no target, and a running cell draws no scene: add one under `targets:`")
        self._world, self._clock, self._has_surroundings = world, clock, surroundings
        self._arms = {
            name: RunningArm(name, kinematics, world.home[name], world.faults, world.seed)
            for name, kinematics in world.robots.items()
        }
        reflection = world.faults.size("reflection")
        self._trays = {name: self._tray(name) for name in world.lenses} if reflection else {}
        self._views = {
            name: CameraView(lens, reflection, Surroundings(self._stage(name), lens) if surroundings else None)
            for name, lens in world.lenses.items()
        }
        self._is_lit = True
        self._shot_count = 0

    def state(self, robot: str) -> tuple[float, Array]:
        """The next state of an arm: its timestamp [s] and its encoder readings, (n,) [rad]."""
        arm, now = self._arm(robot), self._clock.wait(_STATE_PERIOD_S)
        return now, arm.reported_joints(now)

    def move(self, robot: str, joints: Array, speed_rad_s: float) -> None:
        """Start a movement of an arm to joints, (n,) [rad]."""
        self._arm(robot).move(joints, speed_rad_s, self._clock.time_s())
        self._shot_count = 0

    def stop(self, robot: str) -> None:
        """Stop an arm."""
        self._arm(robot).stop(self._clock.time_s())

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the arms."""
        return tuple(self._arms)

    @property
    def is_real_time(self) -> bool:
        """Whether time advances between requests."""
        return self._clock.speed > 0

    def wait(self, seconds: float) -> None:
        """Wait for a time of the cell [s]."""
        self._clock.wait(seconds)

    @property
    def arrived_s(self) -> float:
        """Time at which all arms have arrived [s]."""
        return max(arm.arrival_s for arm in self._arms.values())

    def camera_scene(self, camera: str) -> CameraScene:
        """The current scene in front of a camera."""
        return self._camera_scene(camera, self._clock.time_s())

    def light(self, is_on: bool) -> None:
        """Switch the LED on or off."""
        self._is_lit = is_on

    def shot(self, camera: str) -> Shot:
        """The next image of a camera that is not dropped."""
        if camera not in self._views:
            raise InputError(f"no camera {camera!r}; there are: {', '.join(self._views)}")
        faults, now = self._world.faults, self._clock.wait(_FRAME_PERIOD_S)
        self._shot_count += 1
        while self._image_rng(camera, 1).random() < faults.size("dropped-frames"):
            now = self._clock.wait(_FRAME_PERIOD_S)
            self._shot_count += 1
        begin_s, noise_seed = now + faults.size("late-trigger"), int(self._image_rng(camera, 2).integers(2**62))
        image = self._views[camera].image(
            lambda time_s: self._camera_scene(camera, time_s), begin_s, _EXPOSURE_S, self._is_lit, noise_seed
        )
        return Shot(now + 0.5 * _EXPOSURE_S + faults.size("clock-offset"), image)

    def close(self) -> None:
        """Close the renderers."""
        for view in self._views.values():
            view.close()

    def _image_rng(self, camera: str, stream: int) -> np.random.Generator:
        """Random numbers of an image; they depend only on the arms' goals and the number of images since a move."""
        goals = [arm.goal.round(9).tolist() for arm in self._arms.values()]
        return seeded_generator(self._world.seed, camera, goals, self._shot_count, stream)

    def _arm(self, robot: str) -> RunningArm:
        if robot not in self._arms:
            raise InputError(f"no robot {robot!r}; there are: {', '.join(self._arms)}")
        return self._arms[robot]

    def _camera_scene(self, camera: str, now_s: float) -> CameraScene:
        """The scene in front of a camera at a time [s]."""
        carrier, target, shape = self._world.cell.cameras[camera].on, self._target(camera), self._shape(camera)
        world_from_camera = self._pose_in_world(camera, carrier, now_s)
        world_from_target = self._pose_in_world(target.name, target.on, now_s)
        camera_from_world = world_from_camera.inverse()
        mirror_points = self._mirror_points(camera, world_from_camera, world_from_target @ shape.points)
        body_poses = None
        if self._has_surroundings:
            body_poses = BodyPoses(
                world_from_camera, world_from_target, {name: self._links(name, now_s) for name in self._arms}
            )
        return CameraScene(shape, camera_from_world @ world_from_target, camera_from_world @ mirror_points, body_poses)

    def _tray(self, camera: str) -> Array:
        """Centre of the reflecting tray in the world, (3,) [m], below the LED's initial position."""
        target = self._target(camera)
        world_from_target = self._pose_in_world(target.name, target.on, 0.0)
        return np.asarray(world_from_target @ self._shape(camera).points[0] - [0.0, 0.0, _TRAY_DEPTH_M])

    def _mirror_points(self, camera: str, world_from_camera: SE3, points: Array) -> Array:
        """Mirror images of points in the world, (m, 3) [m]; only if the point and the camera are above the tray."""
        if camera not in self._trays:
            return np.zeros((0, 3))
        height_m = self._trays[camera][2]
        reflected = points[(points[:, 2] > height_m) & (world_from_camera.translation[2] > height_m)]
        return np.asarray(reflected * [1, 1, -1] + [0, 0, 2 * height_m])

    def _target(self, camera: str) -> CellTarget:
        """The target of a camera: the first that is not mounted on the same body."""
        cell = self._world.cell
        carrier = cell.cameras[camera].on
        target = next((each for each in cell.targets.values() if each.on != carrier), None)
        if target is None:
            raise InputError(f"{camera!r} is on {carrier!r}, as all targets are: add one elsewhere in cell.yaml")
        return target

    def _shape(self, camera: str) -> Target:
        target = self._target(camera)
        if target.target is None:
            raise InputError(f"target {target.name!r} has no shape that could be drawn; state its `kind`")
        return target.target

    def _stage(self, camera: str) -> Stage:
        chains = {name: arm.chain for name, arm in self._arms.items()}
        bases = {name: self._base(name).translation for name in self._arms}
        return Stage(chains, bases, self._shape(camera), self._world.seed, self._trays.get(camera))

    def _links(self, robot: str, now_s: float) -> tuple[SE3, ...]:
        """Frames of an arm's base and joints in the world."""
        base = self._base(robot)
        frames = base @ self._arms[robot].joint_frames(now_s)
        return (base, *(frames[joint] for joint in range(len(frames))))

    def _pose_in_world(self, name: str, carrier: str, now_s: float) -> SE3:
        """Pose of a camera or a target in the world, whose z axis points up; gravity bends mounts on flanges."""
        world_from_carrier = self._carrier(carrier, now_s)
        if carrier == WORLD:
            return world_from_carrier @ self._mount(name, carrier)
        moved = self._world.gravity_motion(-world_from_carrier.rotation[2])
        return world_from_carrier @ moved @ self._mount(name, carrier)

    def _carrier(self, carrier: str, now_s: float) -> SE3:
        """Pose of a robot's flange in the world; the identity for the world."""
        if carrier == WORLD:
            return SE3.identity()
        base_from_flange = self._arms[carrier].base_from_flange(now_s)
        return base_from_flange if carrier == self._world.cell.reference else self._base(carrier) @ base_from_flange

    def _base(self, robot: str) -> SE3:
        """Pose of an arm's base in the world."""
        if robot == self._world.cell.reference:
            return SE3.identity()
        return self._world.transform(self._world.cell.base_name(robot), self._is_pushed("base-bumped", robot))

    def _mount(self, name: str, carrier: str) -> SE3:
        return self._world.transform(self._world.cell.mount_name(name), self._is_pushed("board-remounted", carrier))

    def _is_pushed(self, fault: str, robot: str) -> bool:
        return robot != WORLD and self._arms[robot].moves > self._world.faults.delay_moves(fault)


class Clock:
    """Clock of a running cell, in seconds since its start.

    With a `speed` of 0, time advances only in calls of `wait`, exactly by the requested time. The behaviour of a cell
    then depends only on its requests, not on the load of the machine.

    Attributes:
        speed: Seconds of the cell per second of real time.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self._began, self._spent = time.monotonic(), 0.0

    def time_s(self) -> float:
        """The current time [s]."""
        return self._spent if self.speed == 0 else (time.monotonic() - self._began) * self.speed

    def wait(self, seconds: float) -> float:
        """Wait for a time of the cell [s]; the time afterwards [s]."""
        if self.speed == 0:
            self._spent += seconds
        else:
            time.sleep(seconds / self.speed)
        return self.time_s()
