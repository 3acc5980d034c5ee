"""The cell in three dimensions as data: bases, flanges at every sample, cameras and targets."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from basecal.cell import WORLD, Calibration, Cell, CellCamera, CellTarget, ErrorMap, Robot, RobotState, Sample, Target
from basecal.errors import BasecalError
from basecal.fields.digits import two_digits
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.kinematics.surface import body_surface
from basecal.planning.sketch import target_points
from basecal.reporting.cell_view.sample_labels import sample_labels, worst_sample
from basecal.reporting.svg import nice_ceiling

_MOST_SAMPLES = 400
_MOST_POINTS = 200
_SMALLEST_M = 0.2
_FRUSTUM_SHARE = 0.08
_ELLIPSOID_SHARE = 0.06
_TURN_RAD = 0.4
_SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_DECIMALS = 5  # of metres and of parts of quaternions


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot in the scene.

    Attributes:
        name: Name of the robot.
        world_from_base: Pose of its base.
        base_from_flange: Pose of its flange at each sample of the scene, (n,).
        known: Whether the pose was recorded, (n,).
        joints: Frames of its joints in its base at each sample, (n, k); None if poses are recorded.
        surfaces: Collision bodies of its links from its URDF; empty if there are none that can be read.
        ellipsoid: (3, 3) semi-axes of one sigma of the base's position as columns, in its own axes [m]. They are
            enlarged as drawn; None if its pose was not requested.
    """

    name: str
    world_from_base: SE3
    base_from_flange: SE3
    known: BoolArray
    joints: SE3 | None = None
    surfaces: tuple[dict[str, Any], ...] = ()
    ellipsoid: Array | None = None

    @property
    def places(self) -> Array:
        """Positions of base, joints and flange at all samples, (n, 3) [m]."""
        flanges = self.base_from_flange.translation[self.known]
        joints = np.zeros((0, 3)) if self.joints is None else self.joints.translation.reshape(-1, 3)
        return self.world_from_base @ np.concatenate([np.zeros((1, 3)), flanges, joints])

    def world_from_flange(self, index: int) -> SE3 | None:
        """Pose of the flange at a sample of the scene; None if it was not recorded."""
        is_known = len(self.known) and self.known[index]
        return self.world_from_base @ self.base_from_flange[index] if is_known else None


@dataclass(frozen=True, eq=False)
class Body:
    """A camera or a target.

    Attributes:
        name: Name of the camera or target.
        kind: `camera` or `target`.
        on: The robot whose flange carries it; None for the world.
        mount: Pose in the flange, or in the world.
        lines: (k, 2, 3) [m] in its own frame.
        points: (m, 3) [m] in its own frame.
        ellipsoid: See `Arm`.
    """

    name: str
    kind: str
    on: str | None
    mount: SE3
    lines: Array
    points: Array
    ellipsoid: Array | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """The content of a drawing.

    Attributes:
        arms: Arms with known bases.
        bodies: Cameras and targets with known poses.
        samples: Numbers of the shown samples.
        labels: Text about each of these samples.
        opening: Index of the first shown sample: the one with the largest residual, else 0.
        total: Number of all samples.
        size_m: Approximate size of the scene.
        across: Horizontal unit vector that points to the right in the first view, (3,).
        ellipsoid_scale: Factor by which ellipsoids are drawn larger than one sigma.
        errors: Expected errors in the workspace; None if no task is given.
        missing: Names of robots, cameras and targets with unknown poses.
    """

    arms: tuple[Arm, ...]
    bodies: tuple[Body, ...]
    samples: tuple[int, ...]
    labels: tuple[str, ...]
    opening: int
    total: int
    size_m: float
    across: Array
    ellipsoid_scale: float
    errors: ErrorMap | None
    missing: tuple[str, ...]


def scene(cell: Cell, samples: Sequence[Sample], calibration: Calibration) -> Scene:
    """The scene of a calibration with its known transforms; at most a few hundred samples are shown."""
    worst = worst_sample(calibration)
    # An even selection, with the sample of the largest residual.
    step = max(1, -(-len(samples) // _MOST_SAMPLES))
    shown = [sample for index, sample in enumerate(samples) if index % step == 0 or sample.sample == worst]
    numbers = tuple(sample.sample for sample in shown)
    means = {**calibration.known_transforms(cell), cell.base_name(cell.reference): SE3.identity()}
    bases = {name: means.get(cell.base_name(name)) for name in cell.robots}
    arms = tuple(_arm(cell.robots[name], base, shown) for name, base in bases.items() if base is not None)
    points = np.concatenate([arm.places for arm in arms])
    size = max(float(np.linalg.norm(np.ptp(points, axis=0))), _SMALLEST_M)
    scale, ellipsoids = _ellipsoids(cell, calibration, size)
    arms = tuple(replace(arm, ellipsoid=ellipsoids.get(cell.base_name(arm.name))) for arm in arms)
    placed = {WORLD, *(arm.name for arm in arms)}
    items: list[CellCamera | CellTarget] = [*cell.cameras.values(), *cell.targets.values()]
    bodies = tuple(
        _body(each, means[mount], calibration, size, ellipsoids.get(mount))
        for each in items
        if each.on in placed and (mount := cell.mount_name(each.name)) in means
    )
    placed |= {body.name for body in bodies}
    return Scene(
        arms=arms,
        bodies=bodies,
        samples=numbers,
        labels=tuple(sample_labels(numbers, calibration)),
        opening=numbers.index(worst) if worst in numbers else 0,
        total=len(samples),
        size_m=size,
        across=_view_direction(arms),
        ellipsoid_scale=scale,
        errors=calibration.error_map,
        missing=tuple(name for name in (*cell.robots, *cell.cameras, *cell.targets) if name not in placed),
    )


def _arm(robot: Robot, world_from_base: SE3, samples: Sequence[Sample]) -> Arm:
    chain, states = robot.chain, [sample.robots.get(robot.name, RobotState()) for sample in samples]
    joints = [None if chain is None else state.joints_rad for state in states]
    poses = [
        state.base_from_flange if angles is None or chain is None else chain.forward(angles)
        for state, angles in zip(states, joints, strict=True)
    ]
    known = np.array([pose is not None for pose in poses], dtype=bool)
    arm = Arm(robot.name, world_from_base, SE3.stack([pose or SE3.identity() for pose in poses]), known)
    if chain is None or all(angles is None for angles in joints):
        return arm
    frames = chain.joint_frames(np.stack([np.zeros(chain.n) if angles is None else angles for angles in joints]))
    joint_frames = SE3(frames.rotation.swapaxes(0, 1), frames.translation.swapaxes(0, 1))
    try:
        surfaces = tuple(body_surface(body)._asdict() for body in chain.collisions)
    except BasecalError:  # such as a missing mesh: links are drawn as tubes
        surfaces = ()
    return replace(arm, joints=joint_frames, surfaces=surfaces)


def _ellipsoids(cell: Cell, calibration: Calibration, size: float) -> tuple[float, dict[str, Array]]:
    """Scale of the ellipsoids relative to one sigma, and the scaled ellipsoids of known requested transforms."""
    axes = {}
    for name in cell.requested_transforms:
        if name in calibration.transforms and np.all(np.isfinite(calibration[name].covariance)):
            squares, axes[name] = np.linalg.eigh(calibration[name].covariance[:3, :3])
            axes[name][:, 0] *= np.sign(np.linalg.det(axes[name]))  # right-handed
            axes[name] *= np.sqrt(np.maximum(squares, 0.0))
    longest = max((float(np.linalg.norm(each, axis=0).max()) for each in axes.values()), default=0.0)
    scale = 1.0 if longest <= 0 else max(1.0, nice_ceiling(_ELLIPSOID_SHARE * size / longest) / 2)
    return scale, {name: scale * each for name, each in axes.items()}


def _view_direction(arms: Sequence[Arm]) -> Array:
    """Horizontal direction to the base farthest from the world, rotated so that no axis points at the viewer."""
    x, y = max((arm.world_from_base.translation[:2] for arm in arms), key=lambda t: float(np.linalg.norm(t)))
    angle = np.arctan2(y, x) + _TURN_RAD
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _body(
    body: CellCamera | CellTarget, mount: SE3, calibration: Calibration, size: float, ellipsoid: Array | None
) -> Body:
    on = None if body.on == WORLD else body.on
    if isinstance(body, CellTarget):
        points = target_points(body.target)
        some = points[:: -(-len(points) // _MOST_POINTS)]
        return Body(body.name, "target", on, mount, outline(body.target), some, ellipsoid)
    stated = None if body.intrinsics is None else body.intrinsics.camera
    camera, _ = calibration.cameras.get(body.name, (stated, None))
    lines = frustum(camera, _FRUSTUM_SHARE * size)
    return Body(body.name, "camera", on, mount, lines, np.zeros((0, 3)), ellipsoid)


def frustum(camera: Camera | None, length: float) -> Array:
    """Edges of a camera's viewing frustum, (8, 2, 3) [m]; of a typical camera if lens or image size is unknown."""
    rays = np.column_stack([(_SQUARE - 0.5) * [0.8, 0.6], np.ones(4)])
    if camera is not None and camera.size_px is not None:
        corner_rays, valid = camera.undistort(_SQUARE * (np.array(camera.size_px) - 1))
        rays = np.where(valid.all(), corner_rays, rays)
    ends = length * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.concatenate([np.stack([np.zeros((4, 3)), ends], 1), _edges(ends)])


def outline(shape: Target | None) -> Array:
    """Bounding box of a target's points in its plane, or a square around each tag, (k, 2, 3) [m]."""
    if shape is None or len(shape.points) < 3:
        return np.zeros((0, 2, 3))
    if shape.tags is not None:
        return _edges(shape.points[shape.rows(shape.tags.corner_ids.ravel())].reshape(-1, 4, 3)).reshape(-1, 2, 3)
    low, extent = shape.points.min(0), np.ptp(shape.points, axis=0)
    return _edges(low + extent * np.column_stack([_SQUARE, np.zeros(4)]))


def _edges(corners: Array) -> Array:
    """Edges between corners of a loop, (..., n, 2, 3) of (..., n, 3)."""
    return np.stack([corners, np.roll(corners, -1, axis=-2)], -2)


def scene_data(scene: Scene) -> dict[str, Any]:
    """A scene as plain data for the script of the page; positions are rounded to 0.01 mm."""
    data: dict[str, Any] = json.loads(json.dumps(scene, default=_plain))
    return data


def worst_words(errors: ErrorMap) -> str:
    """Text for the position with the largest expected error."""
    return f"worst place: {two_digits(1e3 * float(errors.length_95_m[errors.worst]))} mm"


def _plain(value: Any) -> Any:
    """Convert an object or an array for JSON; a transform becomes its translation and quaternion."""
    if isinstance(value, Arm) and value.joints is not None and not value.surfaces:  # rotations of joints are not drawn
        return {**vars(value), "joints": value.joints.translation}
    if isinstance(value, ErrorMap):
        return {"points": value.points_m, "mm": 1e3 * value.length_95_m, "worst": worst_words(value)}
    if isinstance(value, SE3):
        value = np.concatenate([value.translation, value.quaternion], -1)
    if not isinstance(value, np.ndarray):
        return vars(value)
    return value.tolist() if value.dtype == np.bool_ else np.round(value, _DECIMALS).tolist()
