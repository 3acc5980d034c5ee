"""Cells with one error each from an independent generator: whether good answers are true, and how wide they are.

Two arms of six axes by Denavit-Hartenberg, a pinhole camera on one and a dotted board on the other are simulated in
NumPy alone. Only poses are recorded. Sizes are log-uniform from 0.3 to 3 times a realistic one. A bent mount is a
cantilever: a mass beyond the flange rotates it about a point that is not on the flange. The bound is the Cramer-Rao
bound of the clean cell.

    python -m benchmarks.trouble --cells 20 --families clean both
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import chdtri

import basecal
from benchmarks.common import on_one_core, table, write

Array = npt.NDArray[np.float64]

A_M = np.array([0.0, -0.425, -0.392, 0.0, 0.0, 0.0])
D_M = np.array([0.163, 0.0, 0.0, 0.133, 0.1, 0.1])
TWIST = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])
UPPER_NM, FORE_NM = 60.0, 20.0  # torque of a stretched arm about its shoulder and its elbow
FOCAL_PX, CENTRE_PX = 1150.0, np.array([640.0, 480.0])
BOARD = np.array([[x, y, 0.0] for y in np.arange(6) * 0.03 for x in np.arange(8) * 0.03])
DOWN = np.array([0.0, 0.0, -1.0])
LIMIT = float(chdtri(6, 1e-3))  # 99.9 % quantile of squared distances with six degrees of freedom
_KNOTS = 24
NEAREST_M, FARTHEST_M = 0.35, 0.75
FAR_TASK_M = 0.8  # from the middle of the recorded places to the task of `far`


def rotations(vectors: Array) -> Array:
    """Rotation matrices of rotation vectors, (..., 3) to (..., 3, 3)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross_matrix = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    return np.asarray(
        np.eye(3)
        + np.sinc(angle / np.pi) * cross_matrix
        + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross_matrix @ cross_matrix
    )


def rotation_vectors(rotation: Array) -> Array:
    """Rotation vectors of rotation matrices with angles below half a turn."""
    w = 0.5 * np.stack([rotation[..., i, j] - rotation[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], -1)
    sine = np.linalg.norm(w, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1))
    return np.asarray(w * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 1.0)[..., None])


def transforms(rotation: Array, place: Array) -> Array:
    """Transforms as 4x4 matrices."""
    out = np.zeros((*np.broadcast_shapes(rotation.shape[:-2], place.shape[:-1]), 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = rotation, place, 1.0
    return out


def twist_transforms(tangents: Array) -> Array:
    """Transforms as 4x4 matrices of a translation and a rotation vector, (..., 6)."""
    return transforms(rotations(tangents[..., 3:]), tangents[..., :3])


class Arm(NamedTuple):
    """A true arm: lengths, twists, compliance under the links' weight [rad/Nm], and distortion of its positions."""

    a: Array = A_M
    d: Array = D_M
    twist: Array = TWIST
    compliance: float = 0.0
    distort: Callable[[Array], Array] | None = None

    def flange(self, joints: Array) -> Array:
        """True poses of the flange."""
        bent = joints.copy()
        if self.compliance:
            upper, fore = (np.cos(joints[..., 1:k].sum(-1)) for k in (2, 3))
            bent[..., 1] += self.compliance * (UPPER_NM * upper + FORE_NM * fore)
            bent[..., 2] += self.compliance * FORE_NM * fore
        out = np.broadcast_to(np.eye(4), (*joints.shape[:-1], 4, 4))
        for k in range(6):
            c, s, ca, sa = np.cos(bent[..., k]), np.sin(bent[..., k]), np.cos(self.twist[k]), np.sin(self.twist[k])
            row = np.zeros((*c.shape, 4, 4))
            row[..., 0, 0], row[..., 0, 1], row[..., 0, 2], row[..., 0, 3] = c, -s * ca, s * sa, self.a[k] * c
            row[..., 1, 0], row[..., 1, 1], row[..., 1, 2], row[..., 1, 3] = s, c * ca, -c * sa, self.a[k] * s
            row[..., 2, 1], row[..., 2, 2], row[..., 2, 3], row[..., 3, 3] = sa, ca, self.d[k], 1.0
            out = out @ row
        if self.distort is not None:
            out = out.copy()
            out[..., :3, 3] = self.distort(out[..., :3, 3])
        return np.asarray(out)


NOMINAL = Arm()


def joints_to(flange: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Joints of the nominal arm for flange poses, (n, 4, 4), and whether they are reached, (n,)."""
    best, reached = np.zeros((len(flange), 6)), np.zeros(len(flange), dtype=bool)
    for _ in range(6):
        joints = rng.uniform(-1, 1, best.shape) * 0.4 + [0.0, -1.2, 1.6, -1.5, -1.5, 0.0]
        joints[:, 0] += np.arctan2(flange[:, 1, 3], flange[:, 0, 3]) + np.pi
        for _ in range(30):
            reached_flange = NOMINAL.flange(joints)
            error = _twist(reached_flange, flange)
            shifted = joints[:, None] + 1e-6 * np.eye(6)
            jacobian = np.swapaxes((_twist(reached_flange[:, None], NOMINAL.flange(shifted))) / 1e-6, -1, -2)
            gram = jacobian.mT @ jacobian + 1e-5 * np.eye(6)
            step = np.linalg.solve(gram, jacobian.mT @ error[..., None])[..., 0]
            joints = joints + step * np.minimum(1, 0.5 / np.maximum(np.abs(step).max(1, keepdims=True), 1e-9))
        good = (np.abs(_twist(NOMINAL.flange(joints), flange)).max(1) < 1e-8) & ~reached
        best[good], reached = joints[good], reached | good
    return best, reached


def _twist(first: Array, second: Array) -> Array:
    """Translation and rotation vector from one pose to another, in the first's axes."""
    first_from_second = np.linalg.inv(first) @ second
    return np.concatenate([first_from_second[..., :3, 3], rotation_vectors(first_from_second[..., :3, :3])], -1)


class Truth(NamedTuple):
    """A true cell: transforms, arms, bending of mounts and shift of the lens under gravity, and noise."""

    base: Array
    camera: Array
    board: Array
    eye: Arm
    hand: Arm
    bent_camera: Callable[[Array], Array]
    bent_board: Callable[[Array], Array]
    centre: Callable[[Array], Array]
    pixel_px: float
    arm: Array


def rigid_mount(down: Array) -> Array:
    """Bending of a rigid mount: none."""
    return np.zeros((*down.shape[:-1], 6))


def no_shift(down: Array) -> Array:
    """Shift of a rigid lens: none."""
    return np.zeros((*down.shape[:-1], 2))


def cantilever(angle: float, lever_m: Array, centre_m: Array) -> Callable[[Array], Array]:
    """Bending of a mount with a mass at a lever: a rotation about a point, largest with gravity across the lever."""

    def bend(down: Array) -> Array:
        turn = angle * np.cross(lever_m / np.linalg.norm(lever_m), down)
        return np.concatenate([np.cross(turn, -centre_m), turn], -1)

    return bend


def slot(rng: np.random.Generator, size_m: float) -> Callable[[Array], Array]:
    """Play of a mount along a random axis: it slides to the lower end, by half the play either way."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)

    def slide(down: Array) -> Array:
        shift_m = 0.5 * size_m * np.tanh(4 * down @ axis)
        return np.concatenate([shift_m[:, None] * axis, 0 * down], -1)

    return slide


def board_pixels(truth: Truth, eye: Array, hand: Array) -> Array:
    """Pixels of the board, (n, points, 2), with arms at true poses."""
    down_eye = np.swapaxes(eye[:, :3, :3], 1, 2) @ DOWN
    base_down = truth.base[:3, :3].T @ DOWN
    down_hand = np.swapaxes(hand[:, :3, :3], 1, 2) @ base_down
    camera = eye @ twist_transforms(truth.bent_camera(down_eye)) @ truth.camera
    board = truth.base @ hand @ twist_transforms(truth.bent_board(down_hand)) @ truth.board
    in_camera = (np.linalg.inv(camera) @ board)[:, None] @ np.append(BOARD, np.ones((len(BOARD), 1)), 1)[..., None]
    x, y, z = np.moveaxis(in_camera[..., :3, 0], -1, 0)
    down_camera = np.swapaxes(camera[:, :3, :3], 1, 2) @ DOWN
    return FOCAL_PX * np.stack([x / z, y / z], -1) + CENTRE_PX + truth.centre(down_camera)[:, None]


def bound(truth: Truth, eye: Array, hand: Array) -> Array:
    """Cramer-Rao covariance of the base, (6, 6), with free mounts."""
    step = 1e-6

    def derivative(function: Callable[[Array], Array]) -> Array:
        each = [(function(step * unit) - function(-step * unit)) / (2 * step) for unit in np.eye(6)]
        return np.stack(each, -1).reshape(len(eye), -1, 6)

    unknown = [
        derivative(
            lambda e, name=name: board_pixels(
                truth._replace(**{name: getattr(truth, name) @ twist_transforms(e)}), eye, hand
            )
        )
        for name in ("base", "camera", "board")
    ]
    noisy = [
        derivative(lambda e: board_pixels(truth, eye @ twist_transforms(e), hand)),
        derivative(lambda e: board_pixels(truth, eye, hand @ twist_transforms(e))),
    ]
    x, e = np.concatenate(unknown, -1), np.concatenate(noisy, -1) * np.tile(truth.arm, 2)
    weight = truth.pixel_px**-2
    stop_covariance = np.linalg.inv(np.eye(12) + weight * e.mT @ e)
    information = weight * x.mT @ x - weight**2 * x.mT @ e @ stop_covariance @ e.mT @ x
    return np.asarray(np.linalg.inv(information.sum(0))[:6, :6])


def random_joints(truth: Truth, count: int, rng: np.random.Generator, spread_m: float) -> tuple[Array, Array]:
    """Joints of both arms in samples whose board is in the image, within a box of this half side."""
    joints_found: list[tuple[Array, Array]] = []
    middle = truth.base[:3, 3] / 2 + [0.0, 0.35, 0.35]
    while sum(len(each[0]) for each in joints_found) < count:
        n = 4 * count
        board_place = middle + rng.uniform(-spread_m, spread_m, (n, 3))
        directions = rotations(rng.uniform(-0.6, 0.6, (n, 3)))
        looking = (
            directions
            @ rotations(np.array([0.0, np.pi / 2, 0.0]))
            @ rotations(np.outer(rng.uniform(-0.8, 0.8, n), [0, 0, 1]))
        )
        camera_place = board_place - looking[..., 2] * rng.uniform(NEAREST_M, FARTHEST_M, (n, 1))
        camera = transforms(looking, camera_place + rng.normal(0, 0.03, (n, 3)))
        tilt = rotations(rng.uniform(-0.55, 0.55, (n, 3)))
        board = transforms(looking @ tilt, board_place)
        eye, eye_reached = joints_to(camera @ np.linalg.inv(truth.camera), rng)
        hand, hand_reached = joints_to(np.linalg.inv(truth.base) @ board @ np.linalg.inv(truth.board), rng)
        image_points = board_pixels(truth, NOMINAL.flange(eye), NOMINAL.flange(hand))
        inside = ((image_points > 10) & (image_points < 2 * CENTRE_PX - 10)).all((1, 2))
        usable = eye_reached & hand_reached & inside
        joints_found.append((eye[usable], hand[usable]))
    eyes, hands = (np.concatenate(each)[:count] for each in zip(*joints_found, strict=True))
    return eyes, hands


def clean(rng: np.random.Generator) -> Truth:
    """Draw two arms that face each other, with mounts of some centimetres, and noise of usual arms."""
    base = transforms(
        rotations(np.array([0, 0, np.pi + rng.uniform(-0.2, 0.2)])), np.array([1.25, 0, 0]) + rng.normal(0, 0.05, 3)
    )
    camera = twist_transforms(np.append(rng.normal(0, 0.03, 3) + np.array([0, 0.05, 0.06]), rng.normal(0, 0.1, 3)))
    board = twist_transforms(np.append(rng.normal(0, 0.03, 3) + np.array([-0.1, -0.07, 0.05]), rng.normal(0, 0.1, 3)))
    board = board @ transforms(rotations(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
    arm = 10 ** rng.uniform(-0.3, 0.3) * np.repeat([4e-5, 1e-4], 3)
    return Truth(
        base, camera, board, NOMINAL, NOMINAL, rigid_mount, rigid_mount, no_shift, 10 ** rng.uniform(-1, -0.4), arm
    )


def _size(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))


def _random_cantilever(rng: np.random.Generator, most: float) -> Callable[[Array], Array]:
    lever = rng.normal(size=3) * [1, 1, 0.5]
    return cantilever(most * _size(rng), lever, rng.normal(0, 0.04, 3))


def _lens_shift(shift_px: float) -> Callable[[Array], Array]:
    return lambda down: shift_px * down[..., :2]


def _with_axis_scale(rng: np.random.Generator) -> Arm:
    axis, share = int(rng.integers(3)), 1e-3 * _size(rng) * rng.choice([-1, 1])
    return Arm(distort=lambda positions: positions + share * positions * np.eye(3)[axis])


def _with_link_error(rng: np.random.Generator) -> Arm:
    a, d = A_M.copy(), D_M.copy()
    error_m = 2e-3 * _size(rng) * rng.choice([-1, 1])
    if rng.random() < 0.5:
        a[rng.integers(1, 3)] += error_m
    else:
        d[rng.integers(3, 5)] += error_m
    return Arm(a=a, d=d)


def _with_error_field(rng: np.random.Generator) -> Arm:
    waves, phases = rng.normal(0, 1 / 0.25, (_KNOTS, 3)), rng.uniform(0, 2 * np.pi, _KNOTS)
    sizes = 2e-4 * _size(rng) * rng.normal(size=(_KNOTS, 3)) * np.sqrt(2 / _KNOTS)
    return Arm(distort=lambda positions: positions + np.cos(positions @ waves.T + phases) @ sizes)


def _with_arms(truth: Truth, draw: Callable[[], Arm]) -> Truth:
    return truth._replace(eye=draw(), hand=draw())


FAMILIES: Mapping[str, Callable[[Truth, np.random.Generator], Truth]] = {
    "clean": lambda truth, rng: truth,
    "camera": lambda truth, rng: truth._replace(bent_camera=_random_cantilever(rng, 3.3e-4)),
    "board": lambda truth, rng: truth._replace(bent_board=_random_cantilever(rng, 3.3e-4)),
    "both": lambda truth, rng: truth._replace(
        bent_camera=_random_cantilever(rng, 3.3e-4), bent_board=_random_cantilever(rng, 3.3e-4)
    ),
    "both 1 mrad": lambda truth, rng: truth._replace(
        bent_camera=cantilever(1e-3, rng.normal(size=3), rng.normal(0, 0.04, 3)),
        bent_board=cantilever(1e-3, rng.normal(size=3), rng.normal(0, 0.04, 3)),
    ),
    "play": lambda truth, rng: truth._replace(bent_board=slot(rng, 5e-4 * _size(rng))),
    "lens": lambda truth, rng: truth._replace(centre=_lens_shift(1.5 * _size(rng))),
    "axis": lambda truth, rng: _with_arms(truth, lambda: _with_axis_scale(rng)),
    "link": lambda truth, rng: _with_arms(truth, lambda: _with_link_error(rng)),
    "compliance": lambda truth, rng: _with_arms(truth, lambda: Arm(compliance=2e-5 * _size(rng))),
    "field": lambda truth, rng: _with_arms(truth, lambda: _with_error_field(rng)),
    "far": lambda truth, rng: _with_arms(truth, lambda: _with_link_error(rng)),
    "fixed mount": lambda truth, rng: truth,
    "stated sigma": lambda truth, rng: truth,
}
"""Errors of a cell in addition to its noise, by name."""
BY_PLACE = "axis", "link", "compliance", "field", "far"
"""Families with arm errors: the map counts, not the base."""


def _state_wrong_mount(cell: dict[str, Any], truth: Truth, rng: np.random.Generator) -> str:
    """State a mount as fixed, 0.5 to 20 mm off, and return its name."""
    part, mount, name = (
        (cell["cameras"]["wrist"], truth.camera, "eye_flange_from_wrist"),
        (cell["targets"]["board"], truth.board, "hand_flange_from_board"),
    )[rng.integers(2)]
    direction = rng.normal(size=3)
    off_m = np.exp(rng.uniform(np.log(5e-4), np.log(2e-2))) * direction / np.linalg.norm(direction)
    part["mount"] = {"status": "fixed", "matrix": (mount @ transforms(np.eye(3), off_m)).tolist()}
    return name


def _state_wrong_sigma(cell: dict[str, Any], truth: Truth, rng: np.random.Generator) -> str:
    """State the noise of one arm 10 to 1000 times too large or too small, and return its name."""
    robot = ("eye", "hand")[rng.integers(2)]
    factor = float(np.exp(rng.uniform(np.log(10), np.log(1000)) * rng.choice([-1, 1])))
    cell["robots"][robot] = {"noise": {"sigma_t_m": truth.arm[0] * factor, "sigma_r_rad": truth.arm[3] * factor}}
    return robot


STATEMENTS: Mapping[str, tuple[str, Callable[[dict[str, Any], Truth, np.random.Generator], str]]] = {
    "fixed mount": ("fixed-contradicted", _state_wrong_mount),
    "stated sigma": ("poor-fit", _state_wrong_sigma),
}
"""Families with a wrong statement: the code of the required finding, and the function that states it."""


def write_recording(
    folder: Path, truth: Truth, joints: tuple[Array, Array], stated: bool, rng: np.random.Generator, family: str = ""
) -> str:
    """Write the cell and its recording, and return the name of the wrong statement."""
    lens = {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": CENTRE_PX[0], "cy": CENTRE_PX[1], "distortion": []}
    noise = {"noise": {"sigma_t_m": truth.arm[0], "sigma_r_rad": truth.arm[3]}} if stated else {}
    cell: dict[str, Any] = {
        "schema": "basecal/cell/1",
        "reference": "eye",
        "robots": {"eye": noise, "hand": noise},
        "cameras": {
            "wrist": {
                "on": "eye",
                "model": "pinhole",
                "size_px": [1280, 960],
                "intrinsics": {"status": "fixed", "exact": True, **lens},
            }
        },
        "targets": {"board": {"on": "hand", "kind": "points", "points_m": BOARD.tolist(), "exact": True}},
    }
    if stated:
        cell["noise"] = {"pixel_px": truth.pixel_px}
    wrong = STATEMENTS[family][1](cell, truth, rng) if family in STATEMENTS else ""
    (folder / "cell.yaml").write_text(json.dumps(cell), encoding="utf-8")
    recorded = [NOMINAL.flange(arm_joints) for arm_joints in joints]
    true = [
        arm.flange(arm_joints) @ twist_transforms(rng.normal(size=(len(arm_joints), 6)) * truth.arm)
        for arm, arm_joints in zip((truth.eye, truth.hand), joints, strict=True)
    ]
    image_points = board_pixels(truth, *true)
    image_points = image_points + rng.normal(0, truth.pixel_px, image_points.shape)
    rows = []
    for k in range(len(image_points)):
        robots = {
            name: {"base_from_flange": {"matrix": poses[k].tolist()}}
            for name, poses in zip(("eye", "hand"), recorded, strict=True)
        }
        view = {
            "camera": "wrist",
            "target": "board",
            "ids": list(range(len(BOARD))),
            "pixels": image_points[k].tolist(),
        }
        rows.append(json.dumps({"sample": k, "robots": robots, "observations": [view]}))
    (folder / "recording").mkdir()
    (folder / "recording" / "samples.jsonl").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return wrong


def measure(family: str, seed: int, samples: int, stated: bool) -> dict[str, Any]:
    """Row of one cell: results of `calibrate` and true errors."""
    rng = np.random.default_rng([seed, list(FAMILIES).index("clean")])
    plain = clean(rng)
    joints = tuple(random_joints(plain, samples, rng, 0.08 if family == "far" else 0.22))
    truth = FAMILIES[family](plain, np.random.default_rng([seed, 1 + list(FAMILIES).index(family)]))
    poses = [NOMINAL.flange(arm_joints) for arm_joints in joints]
    base_bound = bound(plain, *poses)
    middle = (truth.base @ poses[1])[:, :3, 3].mean(0)
    point = middle + (FAR_TASK_M * _direction(rng) if family == "far" else 0.0)
    with tempfile.TemporaryDirectory() as name:
        wrong = write_recording(Path(name), truth, joints, stated, rng, family)
        cell, recording = basecal.read_cell(Path(name)), basecal.read_recording(Path(name))
        calibration = basecal.calibrate(cell, recording, basecal.Settings(task_point=tuple(point)))
    row: dict[str, Any] = {
        "family": family,
        "seed": seed,
        "samples": samples,
        "stated": stated,
        "verdict": calibration.verdict,
    }
    if wrong:
        row["named"] = any(f.code == STATEMENTS[family][0] and wrong in f.about for f in calibration.findings)
    row["codes"] = sorted({f"{f.code}:{f.severity}" for f in calibration.findings})
    row["what"] = [f.message for f in calibration.findings if f.severity != "info"]
    base = calibration.transforms.get("eye_base_from_hand_base")
    if base is None:
        return row
    off = _twist(base.mean.matrix, truth.base)
    row["distance"] = float(off @ np.linalg.solve(base.covariance, off))
    row["off_mm"] = 1e3 * float(np.linalg.norm(off[:3]))
    row["sigma_mm"] = 1e3 * float(np.sqrt(np.trace(base.covariance[:3, :3])))
    row["bound_mm"] = 1e3 * float(np.sqrt(np.trace(base_bound[:3, :3])))
    row["over_bound"] = float(np.exp(0.5 * np.mean(np.log(np.diag(base.covariance) / np.diag(base_bound)))))
    if calibration.error_map is not None:
        row["map"] = _on_map(truth, calibration, base.mean.matrix, joints, rng)
    return row


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.normal(size=3) * [0.3, 1, 1]
    return np.asarray(direction / np.linalg.norm(direction))


def _on_map(
    truth: Truth, calibration: Any, base: Array, joints: tuple[Array, Array], rng: np.random.Generator
) -> float:
    """The largest ratio of the true error, where flanges meet, to its 95 % length on the map."""
    points, claimed = calibration.error_map.points_m, calibration.error_map.length_95_m
    meetings = []
    for world, arm_joints, arm in ((np.eye(4), joints[0], truth.eye), (base, joints[1], truth.hand)):
        points_in_base = (np.linalg.inv(world) @ np.append(points, np.ones((len(points), 1)), 1)[..., None])[:, :3, 0]
        poses = NOMINAL.flange(arm_joints)
        nearest = np.linalg.norm(points_in_base[:, None] - poses[:, :3, 3], axis=-1).argmin(1)
        goals = transforms(poses[nearest, :3, :3], points_in_base)
        goal_joints, reached = joints_to(goals, rng)
        meetings.append((arm.flange(goal_joints)[:, :3, 3], reached))
    reached = meetings[0][1] & meetings[1][1]
    hand = (truth.base @ np.append(meetings[1][0], np.ones((len(points), 1)), 1)[..., None])[:, :3, 0]
    off = np.linalg.norm(hand - meetings[0][0], axis=1)
    return float((off / claimed)[reached].max(initial=0.0))


def format_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table with a line for each family, stated and not, and the counts of codes."""
    lines = []
    for family in FAMILIES:
        for stated in (True, False):
            chosen = [row for row in rows if row["family"] == family and row["stated"] == stated]
            if not chosen:
                continue
            good = [row for row in chosen if row["verdict"] == "good"]
            with_base = [row for row in chosen if "distance" in row]
            distances = [row["distance"] for row in good]
            maps = [row["map"] for row in good if "map" in row]
            lines.append(
                (
                    family,
                    "stated" if stated else "nothing stated",
                    f"{len(good)} of {len(chosen)}",
                    sum(d > LIMIT for d in distances),
                    f"{np.mean(distances) / 6:.2f}" if good else "",
                    f"{np.mean([row['distance'] for row in with_base]) / 6:.2f}",
                    f"{np.median([row['over_bound'] for row in with_base]):.2f}" if with_base else "",
                    f"{np.median([row['off_mm'] for row in with_base]):.2f}",
                    sum(m > 1.0 for m in maps),
                    sum(m > 1.68 for m in maps),
                    f"{max(maps, default=0):.2f}",
                    sum(row["named"] for row in chosen) if family in STATEMENTS else "",
                )
            )
    head = (
        "family",
        "noise",
        "good",
        "beyond 99.9 %",
        "NEES/6 good",
        "NEES/6 all",
        "over bound",
        "error [mm]",
        "map beyond 95 %",
        "beyond 1.68",
        "largest",
        "named",
    )
    codes = Counter(code for row in rows for code in row["codes"])
    return f"{table(head, lines)}\n\n{dict(codes.most_common())}"


def section(result: Mapping[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = result["rows"]
    at_base = [row for row in rows if row["verdict"] == "good" and row["family"] not in BY_PLACE]
    by_map = [row["map"] for row in rows if row["verdict"] == "good" and row["family"] in BY_PLACE and "map" in row]
    beyond = sum(row["distance"] > LIMIT for row in at_base)
    clean_cells = sum(row["family"] == "clean" for row in rows)
    beyond_map = sum(length > 1.68 for length in by_map)
    about = f"""\
{len(rows)} cells of a generator that shares no code with the package. {clean_cells} are clean. Each of the others has
one error of 0.3 to 3 times a realistic size.

- Of {len(at_base)} good answers with arms as stated, {beyond} are beyond the 99.9 % ellipsoid at the base.
- Of {len(by_map)} good answers with arms whose errors depend on the place, {beyond_map} are beyond 1.68 times the 95 %
  length somewhere on the map.

`over bound` is the claimed sigma over the Cramer-Rao bound of the clean cell (median). `largest` is the largest error
on the map over its 95 % length."""
    return f"{about}\n\n{format_table(rows).partition(chr(10) * 2)[0]}"


def main(arguments: Sequence[str]) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=60, help="of each family")
    parser.add_argument("--families", nargs="*", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--keep", type=Path, help="file of rows, with their findings in words")
    parser.add_argument("--write", action="store_true", help="write results/trouble.json")
    asked = parser.parse_args(arguments)
    on_one_core()
    rows = []
    for seed in range(asked.first, asked.first + asked.cells):
        for family in asked.families:
            rows.append(measure(family, seed, (15, 30, 60)[seed % 3], (seed // 3) % 2 == 0))
            print(rows[-1], file=sys.stderr, flush=True)
            if asked.keep:
                asked.keep.write_text(json.dumps(rows))
    print(format_table(rows))
    if asked.write:
        write("trouble", {"rows": [{key: value for key, value in row.items() if key != "what"} for row in rows]})


if __name__ == "__main__":
    main(sys.argv[1:])
