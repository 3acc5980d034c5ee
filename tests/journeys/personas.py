"""Newcomers: the files that each has, the commands that each types, and the truth.

Poses of targets are solved from pixels with noise by OpenCV, as programs that people have do. Files are written with
SciPy's rotations and the standard library, not with the code that reads them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3, Array
from basecal.vision.draw.render import render
from basecal.vision.image_file import write_png
from tests.journeys.raw import BOARD, BOARD_OPTIONS, cell, photographs, written
from tests.journeys.raw import LENS as CAMERA
from tests.journeys.raw import recorded as spoken
from tests.journeys.test_production import krl, rapid
from tests.journeys.test_ur import teach_pendant

FOCAL_PX, CENTRE_PX, PIXEL_PX = 900.0, (640.0, 360.0), 0.2
LENS = np.array([[FOCAL_PX, 0, CENTRE_PX[0]], [0, FOCAL_PX, CENTRE_PX[1]], [0, 0, 1]])
TAG_M = 0.04 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]])
BOARD_M = 0.03 * np.array([[x, y, 0.0] for y in range(-2, 3) for x in range(-2, 3)])
FACE = np.diag([1.0, -1.0, -1.0])  # a ChArUco board's z points away from who sees it
IMAGES = 12  # of each board
CELL_OF_THREE = """\
schema: basecal/cell/1
reference: ur
robots: {ur: {}, kuka: {}, abb: {}}
cameras:
  wrist: {on: ur, size_px: [640, 480], intrinsics: {status: free}}
targets:
  board_of_kuka: {on: kuka, kind: charuco, squares: [5, 7], square_m: 0.03, marker_m: 0.0225, dictionary: DICT_4X4_50}
  board_of_abb: {on: abb, kind: charuco, squares: [5, 7], square_m: 0.03, marker_m: 0.0225, dictionary: DICT_5X5_50}
"""
ARM_NOISE = (1e-4, 2e-4)  # [m, rad] per axis of a flange


class Persona(NamedTuple):
    """What somebody types, in a folder with the files that it names; transforms of the cell, and their truth."""

    commands: tuple[str, ...]
    truth: dict[str, SE3]
    cell: str = "mycell"


def ros_sessions(folder: Path, seed: int) -> Persona:
    """Two arms in ROS 2: easy_handeye2 moved each with the other still, in sessions of unequal length."""
    rng = np.random.default_rng(seed)
    eye_from_camera, hand_from_tag, base = (
        near(rng, place) for place in ([0.05, 0, 0.08], [0, 0.02, 0.1], [1.0, 0.2, 0])
    )
    still_hand, counts = near(rng, [0.5, 0.1, 0.4]), rng.integers(13, 25, 2)
    sights = [sighted(rng, int(count)) for count in counts]
    eye = base @ still_hand @ hand_from_tag @ sights[0].inverse() @ eye_from_camera.inverse()
    still_eye = eye[0]
    hand = base.inverse() @ still_eye @ eye_from_camera @ sights[1] @ hand_from_tag.inverse()
    seen = [solved(rng, sight, TAG_M) for sight in sights]
    handeye_file(folder / "left_moves.samples", recorded(rng, eye), seen[0])
    handeye_file(folder / "right_moves.samples", recorded(rng, hand).inverse(), seen[1])
    tf_line(folder / "right_still.txt", recorded(rng, still_hand))
    tf_line(folder / "left_still.txt", recorded(rng, still_eye))
    commands = (
        "basecal import easy-handeye mycell left_moves.samples --camera-on left --target-on right",
        "basecal import poses mycell --robot right right_still.txt --format ros --still",
        "basecal import easy-handeye mycell right_moves.samples --robot right",
        "basecal import poses mycell --robot left left_still.txt --format ros --still",
        "basecal calibrate mycell",
    )
    return Persona(commands, {"left_base_from_right_base": base})


def opencv_arm(folder: Path, seed: int) -> Persona:
    """One arm and OpenCV: an archive of the four arrays that `calibrateHandEye` takes."""
    rng = np.random.default_rng(seed)
    mount, world = near(rng, [0.05, 0, 0.08]), near(rng, [0.6, 0, 0])
    sight = sighted(rng, int(rng.integers(14, 26)))
    arrays = opencv_arrays(rng, world @ sight.inverse() @ mount.inverse(), solved(rng, sight, BOARD_M))
    np.savez(folder / "poses.npz", **arrays)
    commands = ("basecal import arrays mycell poses.npz", "basecal calibrate mycell")
    return Persona(commands, {"eye_flange_from_camera": mount})


def opencv_cameras(folder: Path, seed: int) -> Persona:
    """Two cameras on one arm and OpenCV: a JSON file of each, with the same poses of the arm."""
    rng = np.random.default_rng(seed)
    left, world = near(rng, [0.05, 0, 0.08]), near(rng, [0.6, 0, 0])
    squint = Rotation.from_rotvec(rng.normal(0, 0.03, 3)).as_matrix()
    mounts = [left, left @ SE3(squint, np.array([0.06, 0, 0]) + rng.normal(0, 0.003, 3))]
    sight = sighted(rng, int(rng.integers(14, 26)))
    flange = world @ sight.inverse() @ mounts[0].inverse()
    for name, mount in zip(("left", "right"), mounts, strict=True):
        seen = solved(rng, (flange @ mount).inverse() @ world, BOARD_M)
        arrays = opencv_arrays(np.random.default_rng(seed), flange, seen)
        (folder / f"{name}.json").write_text(json.dumps({key: value.tolist() for key, value in arrays.items()}))
    commands = (
        "basecal import arrays mycell left.json --camera left",
        "basecal import arrays mycell right.json --camera right",
        "basecal calibrate mycell",
    )
    truth = zip(("left", "right"), mounts, strict=True)
    return Persona(commands, {f"eye_flange_from_{name}": mount for name, mount in truth})


def three_makers(folder: Path, seed: int) -> Persona:
    """A UR, a KUKA and an ABB: the first one's camera sees the boards of the others in turn, in one folder."""
    rng = np.random.default_rng(seed)
    mount, home = near(rng, [0.05, 0, 0.08]), near(rng, [0.5, 0.1, 0.4])
    bases = {"kuka": near(rng, [1.0, 0.3, 0]), "abb": near(rng, [-0.2, 1.1, 0])}
    boards = {"kuka": BOARD, "abb": charuco_target((5, 7), 0.03, 0.0225, "DICT_5X5_50")}
    poses: dict[str, list[SE3]] = {"ur": [], "kuka": [], "abb": []}
    (folder / "photos").mkdir()
    for maker, base in bases.items():
        flange_from_board = near(rng, [0, 0.02, 0.1])
        other = next(each for each in bases if each != maker)
        for k, sight in enumerate(board_sights(rng, IMAGES)):
            hand = home @ SE3(Rotation.from_rotvec(rng.normal(0, 0.4, 3)).as_matrix(), rng.normal(0, 0.05, 3))
            eye = base @ hand @ flange_from_board @ sight.inverse() @ mount.inverse()
            for name, pose in (("ur", eye), (maker, hand), (other, home)):
                poses[name].append(recorded(rng, pose))
            image = render(CAMERA, boards[maker], sight, None, int(rng.integers(2**31)))
            write_png(folder / "photos" / f"{maker}_{k + 1:02d}.png", image)
    order = [*range(IMAGES, 2 * IMAGES), *range(IMAGES)]  # as their names sort
    for name, write in (("ur", teach_pendant), ("kuka", krl), ("abb", rapid)):
        told = SE3.stack([poses[name][k] for k in order])
        written(folder / f"{name}.txt", write(told.translation, Rotation.from_matrix(told.rotation)))
    (folder / "mycell").mkdir()
    written(folder / "mycell" / "cell.yaml", CELL_OF_THREE.splitlines())
    commands = (
        *(f"basecal import poses mycell --robot {maker} {maker}.txt --format {maker}" for maker in poses),
        "basecal import images mycell photos --camera wrist",
        "basecal calibrate mycell",
    )
    return Persona(commands, {f"ur_base_from_{maker}_base": base for maker, base in bases.items()})


def production(folder: Path, seed: int) -> Persona:
    """A line with a KUKA and an ABB: a tolerance, and a page for the file of the line."""
    made = cell(samples=18, seed=seed)
    photographs(made, folder, lambda i: f"cam0_{i + 1:04d}.png")
    written(folder / "calib.dat", krl(*spoken(made, "eye")))
    written(folder / "calib.mod", rapid(*spoken(made, "hand")))
    commands = (
        "basecal import poses line4 --robot kuka calib.dat --format kuka",
        "basecal import poses line4 --robot abb calib.mod --format abb",
        f"basecal import images line4 photos --camera flange_cam --on kuka {BOARD_OPTIONS}",
        "basecal calibrate line4 --tolerance 3mm",
        "basecal report line4",
    )
    return Persona(commands, {"kuka_base_from_abb_base": made.truth["eye_base_from_hand_base"]}, "line4")


def hobby_arms(folder: Path, seed: int) -> Persona:
    """Two arms that LeRobot drives, whose joints' zeros are off, and a webcam."""
    from tests.journeys.test_hobby_arms import LINKS, OFFSET_DEG, dataset, frame_name  # which skips without pyarrow

    off = np.radians(OFFSET_DEG)
    made = cell(samples=40, seed=seed, joints=True, joint_offset_rad=off, robot_noise=(0.0, 0.0))
    photographs(made, folder, frame_name)
    for robot, name in (("eye", "leader"), ("hand", "follower")):
        dataset(made, robot, folder / name)
    board = f"{BOARD_OPTIONS} --target-on follower"
    offsets = f"--unit deg {LINKS} --offset-sigma-deg {OFFSET_DEG:g}"
    commands = (
        f"basecal import images mycell photos --camera webcam --on leader --by time {board}",
        f"basecal import lerobot mycell leader --robot leader --urdf leader.urdf {offsets}",
        f"basecal import lerobot mycell follower --robot follower --urdf follower.urdf {offsets}",
        "basecal calibrate mycell",
        "basecal export mycell --to matrix -o base.txt",
    )
    return Persona(commands, {"leader_base_from_follower_base": made.truth["eye_base_from_hand_base"]})


def board_sights(rng: np.random.Generator, count: int) -> list[SE3]:
    """camera_from_board from 0.3 to 0.45 m, all of the board in view."""
    middle = BOARD.points.mean(0)
    facing = sighted(rng, count)
    places = np.c_[rng.normal(0, 0.02, (count, 2)), rng.uniform(0.3, 0.45, count)]
    turned = [rotation @ FACE for rotation in facing.rotation]
    return [SE3(turn, place - turn @ middle) for turn, place in zip(turned, places, strict=True)]


def near(rng: np.random.Generator, place: Sequence[float]) -> SE3:
    """Any rotation at about a place [m]."""
    return SE3(Rotation.random(random_state=rng).as_matrix(), np.array(place) + rng.normal(0, 0.02, 3))


def sighted(rng: np.random.Generator, count: int) -> SE3:
    """camera_from_target (count,) from 0.35 to 0.8 m, tilted by up to 40 deg, rolled at will."""
    tilt, about = rng.uniform(0, 0.7, count), rng.uniform(0, 2 * np.pi, count)
    aslant = Rotation.from_rotvec(tilt[:, None] * np.stack([np.cos(about), np.sin(about), 0 * about], -1))
    rolled = Rotation.from_rotvec(rng.normal(0, 0.5, count)[:, None] * [0, 0, 1.0])
    places = np.c_[rng.normal(0, 0.07, count), rng.normal(0, 0.05, count), rng.uniform(0.35, 0.8, count)]
    return SE3((Rotation.from_rotvec([np.pi, 0, 0]) * rolled * aslant).as_matrix(), places)


def recorded(rng: np.random.Generator, flange: SE3) -> SE3:
    """Poses (n,), or one, as an arm reports them."""
    shape = (*flange.translation.shape[:-1], 3)
    turns = Rotation.from_rotvec(rng.normal(0, ARM_NOISE[1], (*shape[:-1], 3))).as_matrix()
    return SE3(flange.rotation @ turns, flange.translation + rng.normal(0, ARM_NOISE[0], shape))


def solved(rng: np.random.Generator, camera_from_target: SE3, points_in_target: Array) -> SE3:
    """Poses (n,) by `solvePnP` of pixels with noise."""
    way = cv2.SOLVEPNP_IPPE_SQUARE if len(points_in_target) == 4 else cv2.SOLVEPNP_IPPE
    found = []
    for k in range(len(camera_from_target.translation)):
        points = points_in_target @ camera_from_target.rotation[k].T + camera_from_target.translation[k]
        pixels = FOCAL_PX * points[:, :2] / points[:, 2:] + CENTRE_PX + rng.normal(0, PIXEL_PX, (len(points), 2))
        _, turn, place = cv2.solvePnP(points_in_target, pixels, LENS, None, flags=way)
        found.append(cv2.solvePnPRefineLM(points_in_target, pixels, LENS, None, turn, place))
    turns, places = (np.array(part)[..., 0] for part in zip(*found, strict=True))
    return SE3(Rotation.from_rotvec(turns).as_matrix(), places)


def opencv_arrays(rng: np.random.Generator, flange: SE3, seen: SE3) -> dict[str, Array]:
    """What people keep for `calibrateHandEye`: rotation vectors of the target, as `solvePnP` gave them."""
    arm = recorded(rng, flange)
    return {
        "R_gripper2base": arm.rotation,
        "t_gripper2base": arm.translation[..., None],
        "R_target2cam": Rotation.from_matrix(seen.rotation).as_rotvec()[..., None],
        "t_target2cam": seen.translation[..., None],
    }


def handeye_file(path: Path, robot: SE3, tracking: SE3) -> None:
    """A `.samples` of easy_handeye2: a SampleList as YAML; its sampler leaves the parameters empty."""
    lines = ["parameters:", "  name: ''", "  calibration_type: ''", "samples:"]
    for k in range(len(robot.translation)):
        for key, poses in (("- robot:", robot), ("  tracking:", tracking)):
            quaternion = Rotation.from_matrix(poses.rotation[k]).as_quat()
            lines += [key, "    translation:", *entries("xyz", poses.translation[k])]
            lines += ["    rotation:", *entries("xyzw", quaternion)]
    path.write_text("\n".join(lines) + "\n")


def entries(keys: str, values: Array) -> list[str]:
    """Lines of a YAML mapping of numbers."""
    return [f"      {key}: {float(value)!r}" for key, value in zip(keys, values, strict=True)]


def tf_line(path: Path, pose: SE3) -> None:
    """One pose as tf has it: x y z and a quaternion with w last."""
    numbers = [*pose.translation, *Rotation.from_matrix(pose.rotation).as_quat()]
    path.write_text(" ".join(f"{number:.9f}" for number in numbers) + "\n")
