"""Images of a recording as views of a scene, with their features."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from basecal.cell import WORLD, Cell, CellCamera, Finding, Intrinsics, PixelObservation, Recording, Sample
from basecal.cell.format.described_places import DESCRIPTOR_LENGTH
from basecal.errors import InputError
from basecal.estimation.problem.build import recorded_states
from basecal.estimation.problem.stated_lens import with_usual_error
from basecal.estimation.scene.views import AT_WORLD, SceneCamera, SceneViews, Tracks
from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.start.lens import guessed_lens
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.batch import take
from basecal.vision.image_file import grey_image, read_bytes
from basecal.vision.tracks.features import Descriptors, Features, cached_features, identified_features, unit_descriptors

# Focal length of an unstated lens over the image width, a field of view of 58 degrees; assumed, as `_FOCAL_SCALES` of
# `one_camera` try others.
_USUAL_FOCAL = 0.9


@dataclass(frozen=True, eq=False)
class Images:
    """Images of the scene.

    Attributes:
        views: Cameras and robot poses of the images.
        features: Features of each image.
        lenses: Stated or guessed lens of each camera.
        is_guessed: For each camera, whether its lens is a guess because none is stated.
        lost: Findings of images that could not be read.
        mounts: Approximate mount of each camera, None if it is unknown; empty if all are unknown.
        joint_robots: Names of the robots whose joints were recorded.
    """

    views: SceneViews
    features: tuple[Features, ...]
    lenses: tuple[Camera, ...]
    is_guessed: tuple[bool, ...]
    lost: tuple[Finding, ...] = ()
    mounts: tuple[SE3 | None, ...] = ()
    joint_robots: tuple[str, ...] = ()

    def select_moving(self) -> Images:
        """Return the images of cameras on robots."""
        cameras = tuple(camera for camera in self.views.cameras if camera.robot is not None)
        rows = np.flatnonzero(self.views.robot >= 0)
        views = replace(take(self.views, rows), cameras=cameras)
        return replace(self, views=views, features=self.features[: len(rows)])

    def descriptors(self, tracks: Tracks) -> Descriptors:
        """Mean descriptor of each point over its image points, (p, 128) of unit length."""
        total = np.zeros((tracks.count, DESCRIPTOR_LENGTH), dtype=np.float32)
        for view in np.unique(tracks.view):
            mine = np.flatnonzero(tracks.view == view)
            total[tracks.point[mine]] += self.features[view].descriptors[tracks.feature[mine]]
        return unit_descriptors(total)


def read_images(cell: Cell, recording: Recording, settings: Settings = DEFAULT) -> Images:
    """Read the images of all cameras on robots, then one image of each camera on `world`.

    Args:
        cell: Cell with the cameras and robots.
        recording: Samples with images or tracks; features of images are cached in its folder.
        settings: Settings whose progress callback receives the number of images read.

    Raises:
        InputError: if the recording has images and its folder is not known.
    """
    carried = [name for name in cell.cameras if cell.cameras[name].on in cell.robots]
    fixed = [name for name in cell.cameras if cell.cameras[name].on == WORLD]
    taken = [(name, sample) for sample in recording.samples for name in carried if _has_posed_view(cell, name, sample)]
    taken += [
        (name, own[0]) for name in fixed if (own := [s for s in recording.samples if _has_posed_view(cell, name, s)])
    ]
    read = []
    for number, (name, sample) in enumerate(taken, 1):
        settings.report_progress(number, len(taken))
        read.append((name, sample, read_features(cell, name, sample, recording.folder)))
    seen = [(name, sample, *found) for name, sample, found in read if not isinstance(found, str)]
    lost = [_unread_image(name, sample, found) for name, sample, found in read if isinstance(found, str)]
    sizes = {name: size for name, _, _, size in seen}
    names = [name for name in (*carried, *fixed) if name in sizes]
    cameras = tuple(_scene_camera(cell, name) for name in names)
    robots = list(dict.fromkeys(camera.robot for camera in cameras if camera.robot is not None))
    carriers = [*robots, WORLD]
    robot = np.array([carriers.index(cell.cameras[name].on) for name, *_ in seen], dtype=np.int64)
    robot[robot == len(robots)] = -1
    samples = [sample for _, sample, *_ in seen]
    base_from_flange, stop, stop_robot = _robot_states(cell, robots, robot, samples)
    views = SceneViews(
        cameras,
        tuple(robots),
        tuple(AT_WORLD if name == cell.reference else cell.transforms[cell.base_name(name)] for name in robots),
        np.array([sample.sample for sample in samples], dtype=np.int64),
        np.array([names.index(name) for name, *_ in seen], dtype=np.int64),
        robot,
        stop,
        base_from_flange,
        stop_robot,
    )
    lenses = tuple(each.lens.camera or _guess_lens(cell.cameras[each.name], sizes[each.name]) for each in cameras)
    is_guessed = tuple(camera.lens.camera is None for camera in cameras)
    states = {name: [sample.robots[name] for sample in samples if name in sample.robots] for name in robots}
    joint_robots = tuple(name for name in robots if all(state.joints_rad is not None for state in states[name]))
    features = tuple(found for _, _, found, _ in seen)
    return Images(views, features, lenses, is_guessed, tuple(lost), joint_robots=joint_robots)


def _has_posed_view(cell: Cell, camera: str, sample: Sample) -> bool:
    """Whether a sample has an image or tracks of a camera, with the pose of its robot, if any."""
    has_view = camera in sample.images or any(seen.camera == camera for seen in sample.tracks)
    return has_view and cell.cameras[camera].on in (WORLD, *sample.robots)


def read_features(
    cell: Cell, camera: str, sample: Sample, folder: str | None
) -> tuple[Features, tuple[int, int]] | str:
    """Read the features of a view; the view's tracks are used if the sample has any.

    Returns:
        Features, and the image's width and height [px]; or the reason why the image cannot be read.

    Raises:
        InputError: if there are no tracks, and the folder of the images is not known.
    """
    for seen in sample.tracks:
        if seen.camera == camera:
            size_px = cell.cameras[camera].size_px
            return identified_features(seen.tracks, seen.pixels), size_px or _extent(seen.pixels)
    if folder is None:
        raise InputError("the folder of the images is not known; read the recording from its cell's folder")
    root = Path(folder)
    data = read_bytes(root / sample.images[camera])
    if isinstance(data, str):
        return data
    image = grey_image(data, cell.cameras[camera].size_px)
    if isinstance(image, str):
        return image
    found = cached_features(root, hashlib.sha256(data).hexdigest(), image, _moving_targets(cell, sample, camera))
    return found, (image.shape[1], image.shape[0])


def _extent(pixels: Array) -> tuple[int, int]:
    """Width and height of the smallest image that contains the pixels."""
    width, height = np.ceil(pixels.max(0, initial=1.0)).astype(int) + 1
    return int(width), int(height)


def _unread_image(camera: str, sample: Sample, reason: str) -> Finding:
    what = f"The image of {camera} in sample {sample.sample} is not used: {reason}."
    return Finding("dropped-sample", "info", (str(sample.sample), camera), what)


def _moving_targets(cell: Cell, sample: Sample, camera: str) -> list[Array]:
    """Pixels of each target in the image that a robot carries."""
    seen = (each for each in sample.observations if isinstance(each, PixelObservation) and each.camera == camera)
    return [each.pixels for each in seen if cell.targets[each.target].on in cell.robots]


def _guess_lens(camera: CellCamera, size_px: tuple[int, int]) -> Camera:
    return guessed_lens(
        replace(camera, intrinsics=camera.intrinsics or Intrinsics("free"), size_px=size_px), _USUAL_FOCAL
    )


def _scene_camera(cell: Cell, name: str) -> SceneCamera:
    camera = cell.cameras[name]
    lens = with_usual_error(camera.intrinsics or Intrinsics("free"))
    return SceneCamera(name, None if camera.on == WORLD else camera.on, cell.transforms[cell.mount_name(name)], lens)


def _robot_states(
    cell: Cell, robots: Sequence[str], robot: IntArray, samples: Sequence[Sample]
) -> tuple[SE3, IntArray, IntArray]:
    """Recorded robot pose of each view, the stop of each view, and the robot of each stop; see `SceneViews`."""
    rotation, translation = np.tile(np.eye(3), (len(robot), 1, 1)), np.zeros((len(robot), 3))
    stop, owner = np.full(len(robot), -1, dtype=np.int64), list[int]()
    for index, name in enumerate(robots):
        mine = np.flatnonzero(robot == index)
        found = recorded_states(cell, name, [samples[k].robots[name] for k in mine.tolist()])
        rotation[mine], translation[mine] = found.base_from_flange.rotation, found.base_from_flange.translation
        stop[mine] = found.stop_number + len(owner)
        owner += [index] * (int(found.stop_number.max(initial=-1)) + 1)
    return SE3(rotation, translation), stop, np.array(owner, dtype=np.int64)
