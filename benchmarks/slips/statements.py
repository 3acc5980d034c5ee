"""Slips in what is stated: lenses, transforms, sigmas, carriers."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from tests.journeys.raw import BOARD_OPTIONS, LENS

from basecal.geometry import SE3
from benchmarks.slips.desk import CELL, Desk, edit, import_images

OFF_MM = (23.0, 5.0, 1.5)  # in draws 0, 1, 2
OFF_PX = (4.0, 10.0, 25.0)


def shifted_centre(desk: Desk) -> None:
    """From a data sheet."""
    values = LENS.parameters.copy()
    angle = 1.0 + 2.0 * desk.draw
    values[2:4] += OFF_PX[desk.draw % 3] * np.array([np.cos(angle), np.sin(angle)])
    _state_lens(desk, values)


def no_distortion(desk: Desk) -> None:
    """Focal lengths and centre alone."""
    _state_lens(desk, np.r_[LENS.parameters[:4], np.zeros(5)])


def _state_lens(desk: Desk, values: np.ndarray) -> None:
    """A fixed lens in a file of OpenCV's FileStorage."""
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
    """Each number under its name."""
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    numbers = [f"{name}: {float(value)!r}" for name, value in zip(names, LENS.parameters, strict=True)]
    desk.write("lens.yaml", ["width: 640", "height: 480", *numbers])
    desk.steps.append(f"basecal import opencv {CELL} lens.yaml --camera wrist")


def from_cad(desk: Desk) -> None:
    """The base, the mount of the camera, the mount of the board, in turn."""
    truth, made = desk.made.truth, desk.made.cell
    (camera,), (board,) = made.cameras, made.targets
    name, old, new = (
        ("eye_base_from_hand_base", "cameras:", "bases:\n  kuka: {fixed}\ncameras:"),
        (made.mount_name(camera), "    on: ur", "    on: ur\n    mount: {fixed}"),
        (made.mount_name(board), "{on: kuka,", "{on: kuka, mount: {fixed},"),
    )[desk.draw % 3]
    rng = np.random.default_rng(desk.draw)
    aside = rng.normal(size=3)
    off = SE3(np.eye(3), 1e-3 * OFF_MM[desk.draw % 3] * aside / np.linalg.norm(aside))
    desk.steps.append(edit(old, new.replace("{fixed}", f"{{status: fixed, {_written(truth[name] @ off)}}}")))


def _written(pose: SE3) -> str:
    place = [round(float(value), 6) for value in pose.translation]
    turn = [round(float(value), 9) for value in Rotation.from_matrix(pose.rotation).as_quat()]
    return f"t_m: {place}, q_xyzw: {turn}"


def tiny_sigmas(desk: Desk) -> None:
    """Micrometres meant as millimetres, of both arms."""
    for robot in ("ur", "kuka"):
        noise = "    noise: {sigma_t_m: 1.0e-7, sigma_r_rad: 2.0e-7}"
        desk.steps.append(edit(f"  {robot}:\n", f"  {robot}:\n{noise}\n"))


def sigmas_in_mm(desk: Desk) -> None:
    """0.1 mm and 0.01 deg, as the data sheet says."""
    desk.steps.append(edit("  ur:\n", "  ur:\n    noise: {sigma_t_m: 0.1, sigma_r_rad: 0.01}\n"))


def target_on_world(desk: Desk) -> None:
    """The board is on the KUKA."""
    desk.steps[2] = import_images(options=f"{BOARD_OPTIONS} --target-on world")


def target_on_camera_arm(desk: Desk) -> None:
    """The board is on the KUKA."""
    desk.steps[2] = import_images(options=f"{BOARD_OPTIONS} --target-on ur")


def on_ur5(desk: Desk) -> None:
    """There is a robot `ur`."""
    desk.steps[2] = import_images("ur5")
