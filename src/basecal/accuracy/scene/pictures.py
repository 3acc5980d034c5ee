"""The pictures of a recording as views of a scene, with the features that they show."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.cell import Cell, Intrinsics, PixelObservation, Recording, RobotState, Sample, Unknown
from basecal.errors import InputError
from basecal.estimation.problem.same_stop import stop_numbers
from basecal.estimation.problem.stated_lens import with_usual_error
from basecal.estimation.scene.views import SceneCamera, SceneViews
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.vision.image_file import grey_image, read_bytes
from basecal.vision.tracks.feature_cache import kept_features
from basecal.vision.tracks.features import Features

_USUAL_FOCAL = 0.9  # of the image's width, of a lens of which nothing is stated: 58 degrees wide


@dataclass(frozen=True, eq=False)
class Pictures:
    """Pictures of the scene.

    Attributes:
        views: Their cameras and poses.
        features: Of each.
        lenses: By camera, as stated or guessed.
        is_guessed: By camera, whether nothing of its lens is stated.
    """

    views: SceneViews
    features: tuple[Features, ...]
    lenses: tuple[Camera, ...]
    is_guessed: tuple[bool, ...]

    def camera_views(self, camera: int) -> list[int]:
        """The views of a camera."""
        return np.flatnonzero(self.views.camera == camera).tolist()


def read_pictures(cell: Cell, recording: Recording, folder: Path) -> Pictures:
    """The pictures of all cameras that a robot carries.

    Args:
        cell: Its cameras and robots.
        recording: Its samples, with pictures.
        folder: From which the paths of pictures count, and where features are kept.
    """
    names = [name for name in cell.cameras if cell.cameras[name].on in cell.robots]
    taken = [(name, sample) for sample in recording.samples for name in names if _has_pose(cell, name, sample)]
    read = [(name, sample, _read(cell, name, sample, folder)) for name, sample in taken]
    seen = [(name, sample, found) for name, sample, found in read if found is not None]
    cameras = tuple(_scene_camera(cell, name) for name in names if any(name == each for each, _, _ in seen))
    by_name = {camera.name: k for k, camera in enumerate(cameras)}
    robots = list(dict.fromkeys(cell.cameras[camera.name].on for camera in cameras))
    robot = np.array([robots.index(cell.cameras[name].on) for name, _, _ in seen], dtype=np.int64)
    poses = [_pose(cell, cell.cameras[name].on, sample.robots[cell.cameras[name].on]) for name, sample, _ in seen]
    stop, stop_robot = _stops(robot, poses)
    views = SceneViews(
        cameras,
        tuple(robots),
        tuple(_base(cell, name) for name in robots),
        np.array([sample.sample for _, sample, _ in seen], dtype=np.int64),
        np.array([by_name[name] for name, _, _ in seen], dtype=np.int64),
        robot,
        stop,
        SE3.stack(poses) if poses else SE3.identity((0,)),
        stop_robot,
    )
    sizes = {name: size for name, _, (_, size) in seen}
    lenses = tuple(camera.lens.camera or guessed_lens(camera.lens, sizes[camera.name]) for camera in cameras)
    features = tuple(found for _, _, (found, _) in seen)
    return Pictures(views, features, lenses, tuple(camera.lens.camera is None for camera in cameras))


def _has_pose(cell: Cell, camera: str, sample: Sample) -> bool:
    """Whether a sample has a picture of a camera, and the pose of the robot that carries it."""
    return camera in sample.images and cell.cameras[camera].on in sample.robots


def _read(cell: Cell, camera: str, sample: Sample, folder: Path) -> tuple[Features, tuple[int, int]] | None:
    """Features of a picture, and its width and height; None if it cannot be read."""
    data = read_bytes(folder / sample.images[camera])
    if isinstance(data, str):
        return None
    image = grey_image(data, cell.cameras[camera].size_px)
    if isinstance(image, str):
        return None
    found = kept_features(folder, hashlib.sha256(data).hexdigest(), image, _moving_targets(cell, sample, camera))
    return found, (image.shape[1], image.shape[0])


def _moving_targets(cell: Cell, sample: Sample, camera: str) -> list[Array]:
    """Pixels of each target that a picture shows and a robot carries."""
    seen = (each for each in sample.observations if isinstance(each, PixelObservation) and each.camera == camera)
    return [each.pixels for each in seen if cell.targets[each.target].on in cell.robots]


def guessed_lens(lens: Intrinsics, size_px: tuple[int, int]) -> Camera:
    """A usual lens for pictures of this size."""
    width, height = size_px
    focal = _USUAL_FOCAL * width
    terms = 5 if lens.distortion_terms is None else lens.distortion_terms
    parameters = [focal, focal, (width - 1) / 2, (height - 1) / 2, *[0.0] * terms]
    return Camera("pinhole", np.array(parameters), size_px)


def _scene_camera(cell: Cell, name: str) -> SceneCamera:
    camera = cell.cameras[name]
    lens = with_usual_error(camera.intrinsics or Intrinsics("free"))
    return SceneCamera(name, camera.on, cell.transforms[cell.mount_name(name)], lens)


def _base(cell: Cell, robot: str) -> Unknown:
    return Unknown("fixed", SE3.identity()) if robot == cell.reference else cell.transforms[cell.base_name(robot)]


def _pose(cell: Cell, robot: str, state: RobotState) -> SE3:
    if state.base_from_flange is not None:
        return state.base_from_flange
    chain = cell.robots[robot].chain
    if chain is None or state.joints_rad is None:
        raise InputError(f"robot {robot!r} is recorded by joints and has no urdf")
    return chain.forward(state.joints_rad)


def _stops(robot: IntArray, poses: Sequence[SE3]) -> tuple[IntArray, IntArray]:
    """The stop of each view, and the robot of each stop."""
    stop, owner = np.zeros(len(robot), dtype=np.int64), list[int]()
    for index in np.unique(robot):
        mine = np.flatnonzero(robot == index)
        numbers = stop_numbers(SE3.stack([poses[k] for k in mine.tolist()]), None, None)
        stop[mine] = numbers + len(owner)
        owner += [int(index)] * (int(numbers.max(initial=-1)) + 1)
    return stop, np.array(owner, dtype=np.int64)
