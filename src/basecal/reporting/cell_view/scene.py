"""The cell in three dimensions as data: bases, flanges at every sample, cameras and targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, is_dataclass, replace
from typing import Any

import numpy as np

from basecal.cell import WORLD, Calibration, Cell, CellCamera, CellTarget, ErrorMap, Robot, Sample, Target
from basecal.errors import BasecalError
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.kinematics.surface import Surface, body_surface
from basecal.reporting.cell_view.sample_labels import sample_labels, worst_sample
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import nice_ceiling

_MOST_SAMPLES = 400
_MOST_POINTS = 200
_SMALLEST_M = 0.2
_FRUSTUM_SHARE = 0.08
_ELLIPSOID_SHARE = 0.06
_TURN_RAD = 0.4
_DECIMALS = 5  # of metres and of parts of quaternions


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot in the scene.

    Attributes:
        name: Its name.
        world_from_base: Where its base is.
        base_from_flange: (n,) where its flange is at each sample of the scene.
        known: (n,) whether that was recorded.
        joints: (n, k) frames of its joints in its base at each sample; None if poses are recorded.
        surfaces: Bodies of its links as its URDF has them; empty if there are none that can be read.
        ellipsoid: (3, 3) semi-axes of one sigma of the base's position as columns, in its own axes [m]. They are as
            large as they are drawn; None if its place was not requested.
    """

    name: str
    world_from_base: SE3
    base_from_flange: SE3
    known: BoolArray
    joints: SE3 | None = None
    surfaces: tuple[Surface, ...] = ()
    ellipsoid: Array | None = None

    @property
    def places(self) -> Array:
        """Where its base, its joints and its flange are at all samples, (n, 3) [m]."""
        flanges = self.base_from_flange.translation[self.known]
        joints = np.zeros((0, 3)) if self.joints is None else self.joints.translation.reshape(-1, 3)
        return self.world_from_base @ np.concatenate([np.zeros((1, 3)), flanges, joints])


@dataclass(frozen=True, eq=False)
class Body:
    """A camera or a target.

    Attributes:
        name: Its name.
        kind: `camera` or `target`.
        on: The robot whose flange carries it; None on world.
        mount: Where it is on that flange, or in world.
        lines: (k, 2, 3) [m] in its own frame.
        points: (m, 3) [m] in its own frame.
        ellipsoid: As of an `Arm`.
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
    """All there is to draw.

    Attributes:
        arms: Those whose place is known.
        bodies: Those whose place is known.
        samples: Numbers of the samples shown.
        labels: What there is to say of each of these samples.
        opening: Index of the sample that is shown at first: the one that fits worst, else the first.
        total: How many samples there are.
        size_m: Length that the whole is about as large as.
        across: (3,) horizontal unit vector that stands across the first view of it.
        ellipsoid_scale: How many times larger than one sigma the ellipsoids are drawn.
        errors: The error to be expected at places of the workspace; None if no task is named.
        missing: Names of robots, cameras and targets whose place is not known.
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
    """The scene of a calibration: what it knows, or the cell states as fixed; of many samples some hundred."""
    worst = worst_sample(calibration)
    # Evenly some of them, with the one that fits worst.
    step = max(1, -(-len(samples) // _MOST_SAMPLES))
    shown = [sample for place, sample in enumerate(samples) if place % step == 0 or sample.sample == worst]
    numbers = tuple(sample.sample for sample in shown)
    means = {**calibration.known_transforms(cell), cell.base_name(cell.reference): SE3.identity()}
    robots = [robot for robot in cell.robots.values() if cell.base_name(robot.name) in means]
    arms = tuple(_arm(robot, means[cell.base_name(robot.name)], shown) for robot in robots)
    size = _size(arms)
    scale, sure = _ellipsoids(cell, calibration, size)
    arms = tuple(replace(arm, ellipsoid=sure.get(cell.base_name(arm.name))) for arm in arms)
    placed = {WORLD, *(arm.name for arm in arms)}
    things: list[CellCamera | CellTarget] = [*cell.cameras.values(), *cell.targets.values()]
    drawn = {t.name: t for t in things if t.on in placed and cell.mount_name(t.name) in means}
    bodies = tuple(_body(t, means[cell.mount_name(t.name)], calibration, size) for t in drawn.values())
    bodies = tuple(replace(body, ellipsoid=sure.get(cell.mount_name(body.name))) for body in bodies)
    missing = [name for name in (*cell.robots, *cell.cameras, *cell.targets) if name not in placed | drawn.keys()]
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
        missing=tuple(missing),
    )


def _arm(robot: Robot, world_from_base: SE3, samples: Sequence[Sample]) -> Arm:
    poses: list[SE3 | None] = []
    for sample in samples:
        state = sample.robots.get(robot.name)
        if state is not None and state.joints_rad is not None and robot.chain is not None:
            poses.append(robot.chain.forward(state.joints_rad))
        else:
            poses.append(None if state is None else state.base_from_flange)
    known = np.array([pose is not None for pose in poses], dtype=bool)
    flanges = SE3.stack([pose or SE3.identity() for pose in poses])
    joints = _joints(robot, samples)
    surfaces = () if joints is None else _surfaces(robot)
    return Arm(robot.name, world_from_base, flanges, known, joints, surfaces)


def _surfaces(robot: Robot) -> tuple[Surface, ...]:
    try:
        return tuple(body_surface(body) for body in (robot.chain.collisions if robot.chain else ()))
    except BasecalError:  # such as a mesh that was not copied into the cell's folder: links are tubes
        return ()


def _joints(robot: Robot, samples: Sequence[Sample]) -> SE3 | None:
    """Frames of an arm's joints in its base by its URDF, (n, k); at zero where a sample has no joints of it."""
    states = [sample.robots.get(robot.name) for sample in samples]
    if robot.chain is None or not any(state and state.joints_rad is not None for state in states):
        return None
    at_zero = np.zeros(robot.chain.n)
    joints = [at_zero if state is None or state.joints_rad is None else state.joints_rad for state in states]
    frames = robot.chain.joint_frames(np.stack(joints))
    return SE3(frames.rotation.swapaxes(0, 1), frames.translation.swapaxes(0, 1))


def _ellipsoids(cell: Cell, calibration: Calibration, size: float) -> tuple[float, dict[str, Array]]:
    """How many times as large as one sigma ellipsoids are drawn, and those of requested transforms that are known."""
    axes = {}
    for name in cell.requested_transforms:
        if name in calibration.transforms and np.all(np.isfinite(calibration[name].covariance)):
            squares, axes[name] = np.linalg.eigh(calibration[name].covariance[:3, :3])
            axes[name][:, 0] *= np.sign(np.linalg.det(axes[name]))  # right-handed
            axes[name] *= np.sqrt(np.maximum(squares, 0.0))
    longest = max((float(np.linalg.norm(each, axis=0).max()) for each in axes.values()), default=0.0)
    scale = 1.0 if longest <= 0 else max(1.0, nice_ceiling(_ELLIPSOID_SHARE * size / longest) / 2)
    return scale, {name: scale * each for name, each in axes.items()}


def _size(arms: Sequence[Arm]) -> float:
    """Diagonal of the box about all bases and flanges [m]."""
    every = np.concatenate([arm.places for arm in arms])
    return max(float(np.linalg.norm(every.max(0) - every.min(0))), _SMALLEST_M)


def _view_direction(arms: Sequence[Arm]) -> Array:
    """The horizontal direction towards the base farthest from world, turned so that no axis is seen end on."""
    x, y = max((arm.world_from_base.translation[:2] for arm in arms), key=lambda t: float(np.linalg.norm(t)))
    angle = np.arctan2(y, x) + _TURN_RAD
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _body(body: CellCamera | CellTarget, mount: SE3, calibration: Calibration, size: float) -> Body:
    on = None if body.on == WORLD else body.on
    if isinstance(body, CellCamera):
        lens = body.intrinsics.camera if body.intrinsics is not None else None
        camera = calibration.cameras[body.name][0] if body.name in calibration.cameras else lens
        return Body(body.name, "camera", on, mount, frustum(camera, _FRUSTUM_SHARE * size), np.zeros((0, 3)))
    shape = body.target
    points = np.zeros((1, 3)) if shape is None else shape.points
    return Body(body.name, "target", on, mount, outline(shape), points[:: -(-len(points) // _MOST_POINTS)])


def frustum(camera: Camera | None, length: float) -> Array:
    """Edges of what a camera sees, (8, 2, 3) [m]; of a usual one where its lens or image is not known."""
    rays = np.array([[-0.4, -0.3, 1.0], [0.4, -0.3, 1.0], [0.4, 0.3, 1.0], [-0.4, 0.3, 1.0]])
    if camera is not None and camera.size_px is not None:
        width, height = camera.size_px
        corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], dtype=np.float64)
        looking, valid = camera.undistort(corners)
        rays = np.where(valid.all(), looking, rays)
    ends = length * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.concatenate([np.stack([np.zeros((4, 3)), ends], 1), np.stack([ends, np.roll(ends, -1, 0)], 1)])


def outline(shape: Target | None) -> Array:
    """The box about a target's points in its plane, a square round each tag, (k, 2, 3) [m]."""
    if shape is None or len(shape.points) < 3:
        return np.zeros((0, 2, 3))
    if shape.tags is not None:
        loops = shape.points[shape.rows(shape.tags.corner_ids.ravel())].reshape(-1, 4, 3)
    else:
        low, high = shape.points.min(0), shape.points.max(0)
        x, y, z = np.stack([low, high], -1)
        loops = np.array([[[x[0], y[0], z[0]], [x[1], y[0], z[0]], [x[1], y[1], z[0]], [x[0], y[1], z[0]]]])
    return np.stack([loops, np.roll(loops, -1, axis=1)], 2).reshape(-1, 2, 3)


def scene_data(scene: Scene) -> dict[str, Any]:
    """A scene as plain data for the script of the page; lengths to 0.01 mm."""
    data: dict[str, Any] = _plain(scene)
    for arm, plain in zip(scene.arms, data["arms"], strict=True):
        if arm.joints is not None and not arm.surfaces:  # no body turns with them
            plain["joints"] = _plain(arm.joints.translation)
    if scene.errors is not None:
        data["errors"] = {
            "points": _plain(scene.errors.points_m),
            "mm": _plain(1e3 * scene.errors.length_95_m),
            "worst": worst_words(scene.errors),
        }
    return data


def worst_words(errors: ErrorMap) -> str:
    """Words of the worst place."""
    return f"worst place: {two_digits(1e3 * float(errors.length_95_m[errors.worst]))} mm"


def _plain(value: Any) -> Any:
    """Fields, transforms and arrays as JSON holds them; of a transform its translation, then its quaternion."""
    if isinstance(value, SE3):
        return _plain(np.concatenate([value.translation, value.quaternion], -1))
    if isinstance(value, np.ndarray) and value.dtype != np.float64:
        return value.tolist()
    if isinstance(value, np.ndarray | float):
        return np.round(value, _DECIMALS).tolist()
    if isinstance(value, Surface):
        return _plain(value._asdict())
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return _plain(vars(value)) if is_dataclass(value) else value
