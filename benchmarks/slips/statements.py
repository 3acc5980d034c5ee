"""Slips in statements: lenses, transforms, sigmas, carriers."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from tests.journeys.raw import BOARD_OPTIONS, LENS

from basecal.geometry import SE3
from benchmarks.slips.desk import CELL, Desk, edit, import_images

OFF_MM = (23.0, 5.0, 1.5)  # in draws 0, 1, 2
OFF_PX = (4.0, 10.0, 25.0)


def shifted_centre(desk: Desk) -> None:
    """State a lens with a wrong principal point, as from a data sheet."""
    values = LENS.parameters.copy()
    angle = 1.0 + 2.0 * desk.draw
    values[2:4] += OFF_PX[desk.draw % 3] * np.array([np.cos(angle), np.sin(angle)])
    _state_lens(desk, values)


def no_distortion(desk: Desk) -> None:
    """State a lens by its focal lengths and centre alone."""
    _state_lens(desk, np.r_[LENS.parameters[:4], np.zeros(5)])


def _state_lens(desk: Desk, values: np.ndarray) -> None:
    """Write and import a fixed lens in OpenCV's FileStorage format."""
    fx, fy, cx, cy, *distortion = (float(value) for value in values)
    numbers = ", ".join(f"{value!r}" for value in (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0))
    desk.write(
        "lens.yml",
        [
            "%YAML:1.0",
            "---",
            "image_width: 640",
            "image_height: 480",
            "camera_matrix: !!opencv-matrix",
            "   rows: 3",
            "   cols: 3",
            "   dt: d",
            f"   data: [ {numbers} ]",
            "distortion_coefficients: !!opencv-matrix",
            "   rows: 1",
            "   cols: 5",
            "   dt: d",
            f"   data: [ {', '.join(f'{value!r}' for value in distortion[:5])} ]",
        ],
    )
    desk.steps.append(f"basecal import opencv {CELL} lens.yml --camera wrist")


def own_yaml(desk: Desk) -> None:
    """State a lens in a YAML file with a name for each number."""
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    numbers = [f"{name}: {float(value)!r}" for name, value in zip(names, LENS.parameters, strict=True)]
    desk.write("lens.yaml", ["width: 640", "height: 480", *numbers])
    desk.steps.append(f"basecal import opencv {CELL} lens.yaml --camera wrist")


def from_cad(desk: Desk) -> None:
    """State a wrong base, camera mount or board mount as fixed, by the draw."""
    truth, cell = desk.made.truth, desk.made.cell
    (camera,), (board,) = cell.cameras, cell.targets
    name, old, new = (
        ("eye_base_from_hand_base", "cameras:", "bases:\n  kuka: {fixed}\ncameras:"),
        (cell.mount_name(camera), "    on: ur", "    on: ur\n    mount: {fixed}"),
        (cell.mount_name(board), "{on: kuka,", "{on: kuka, mount: {fixed},"),
    )[desk.draw % 3]
    rng = np.random.default_rng(desk.draw)
    direction = rng.normal(size=3)
    off = SE3(np.eye(3), 1e-3 * OFF_MM[desk.draw % 3] * direction / np.linalg.norm(direction))
    desk.steps.append(edit(old, new.replace("{fixed}", f"{{status: fixed, {_pose_yaml(truth[name] @ off)}}}")))


def _pose_yaml(pose: SE3) -> str:
    place = [round(float(value), 6) for value in pose.translation]
    turn = [round(float(value), 9) for value in Rotation.from_matrix(pose.rotation).as_quat()]
    return f"t_m: {place}, q_xyzw: {turn}"


def tiny_sigmas(desk: Desk) -> None:
    """State sigmas of both arms that are 1000 times too small."""
    for robot in ("ur", "kuka"):
        noise = "    noise: {sigma_t_m: 1.0e-7, sigma_r_rad: 2.0e-7}"
        desk.steps.append(edit(f"  {robot}:\n", f"  {robot}:\n{noise}\n"))


def sigmas_in_mm(desk: Desk) -> None:
    """State 0.1 mm and 0.01 deg of the data sheet as metres and radians."""
    desk.steps.append(edit("  ur:\n", "  ur:\n    noise: {sigma_t_m: 0.1, sigma_r_rad: 0.01}\n"))


def target_on_world(desk: Desk) -> None:
    """State the board, which is on the KUKA, on the world."""
    desk.steps[2] = import_images(options=f"{BOARD_OPTIONS} --target-on world")


def target_on_camera_arm(desk: Desk) -> None:
    """State the board, which is on the KUKA, on the UR."""
    desk.steps[2] = import_images(options=f"{BOARD_OPTIONS} --target-on ur")


def on_ur5(desk: Desk) -> None:
    """Import images on `ur5`, while the robot is named `ur`."""
    desk.steps[2] = import_images("ur5")
