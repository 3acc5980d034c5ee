"""Changes that apply a mistake to the files of a cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from mistakes.cells import Line, change_cell, images, lines_of, samples_file, write_lines

Change = Callable[[Path], None]
Pose = dict[str, Any]
SEEN = ""  # the name by which poses of the observed target are meant, beside those of robots


def each_pose(*names: str, of: Callable[[Pose], object]) -> Change:
    """Change each recorded pose of the named robots, or of the observed target, in place."""

    def change(folder: Path) -> None:
        lines = lines_of(folder)
        for pose in _poses(lines, names):
            of(pose)
        write_lines(folder, lines)

    return change


def _poses(lines: list[Line], names: tuple[str, ...]) -> Iterator[Pose]:
    for line in lines:
        for name in names:
            if name == SEEN:
                yield from (seen["camera_from_target"] for seen in line["observations"])
            else:
                yield line["robots"][name]["base_from_flange"]


def each_line(of: Callable[[Line], object]) -> Change:
    """Change each recorded sample in place."""

    def change(folder: Path) -> None:
        lines = lines_of(folder)
        for line in lines:
            of(line)
        write_lines(folder, lines)

    return change


def all_lines(of: Callable[[list[Line]], list[Line]]) -> Change:
    """Replace the list of recorded samples."""
    return lambda folder: write_lines(folder, of(lines_of(folder)))


def in_cell(of: Callable[[Any], object]) -> Change:
    """Change the data of `cell.yaml`."""
    return lambda folder: change_cell(folder, of)


def in_text(old: str, new: str, name: str = "cell.yaml") -> Change:
    """Replace the first occurrence of a text in a file."""

    def change(folder: Path) -> None:
        path = folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


def in_line(number: int, old: str, new: str) -> Change:
    """Replace the first occurrence of a text in one line of the samples."""

    def change(folder: Path) -> None:
        lines = samples_file(folder).read_text().splitlines(keepends=True)
        assert old in lines[number]
        lines[number] = lines[number].replace(old, new, 1)
        samples_file(folder).write_text("".join(lines))

    return change


def each_image(of: Callable[[Any], Any], every: int = 1) -> Change:
    """Write changed images."""

    def change(folder: Path) -> None:
        for path in images(folder)[::every]:
            cv2.imwrite(str(path), of(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))

    return change


def rotation_of(pose: Pose) -> Rotation:
    """Rotation of a pose that is written as a quaternion."""
    return Rotation.from_quat(pose["q_xyzw"])


def relist(meant: str, read: str) -> Callable[[Pose], None]:
    """Write angles in one convention, of which '' is a rotation vector, and read them in another; names as in SciPy."""

    def of(pose: Pose) -> None:
        turned = rotation_of(pose)
        numbers = turned.as_euler(meant) if meant else turned.as_rotvec()
        wrong = Rotation.from_euler(read, numbers) if read else Rotation.from_rotvec(numbers)
        pose["q_xyzw"] = wrong.as_quat().tolist()

    return of


def as_rpy(unit: float) -> Callable[[Pose], None]:
    """Write roll, pitch and yaw in degrees times `unit`."""

    def of(pose: Pose) -> None:
        pose["rpy_deg"] = (unit * rotation_of(pose).as_euler("xyz", degrees=True)).tolist()
        del pose["q_xyzw"]

    return of


def as_rotvec(unit: float) -> Callable[[Pose], None]:
    """Write rotation vectors in radians times `unit`."""

    def of(pose: Pose) -> None:
        pose["rotvec_rad"] = (unit * rotation_of(pose).as_rotvec()).tolist()
        del pose["q_xyzw"]

    return of


def _matrix(pose: Pose) -> Any:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_of(pose).as_matrix(), pose["t_m"]
    return matrix


def _put(pose: Pose, matrix: Any) -> None:
    pose.clear()
    pose["matrix"] = matrix.tolist()


def invert(pose: Pose) -> None:
    """Invert a pose."""
    _put(pose, np.linalg.inv(_matrix(pose)))


def transpose(pose: Pose) -> None:
    """Write the 4x4 matrix by columns."""
    _put(pose, _matrix(pose).T)


def transpose_rotation(pose: Pose) -> None:
    """Write the rotation matrix by columns."""
    matrix = _matrix(pose)
    matrix[:3, :3] = matrix[:3, :3].T
    _put(pose, matrix)


def scale(factor: float) -> Callable[[Pose], None]:
    """Multiply the translation by a factor."""

    def of(pose: Pose) -> None:
        pose["t_m"] = [factor * value for value in pose["t_m"]]

    return of


def wxyz(pose: Pose) -> None:
    """Write the scalar of a quaternion first."""
    x, y, z, w = pose["q_xyzw"]
    pose["q_xyzw"] = [w, x, y, z]


def joints_times(factor: float, *names: str) -> Change:
    """Write joints in another unit."""

    def of(line: Line) -> None:
        for name in names:
            state = line["robots"][name]
            state["joints_rad"] = [factor * value for value in state["joints_rad"]]

    return each_line(of)


def each_pixel(of: Callable[[Any], Any]) -> Change:
    """Change all pixels, (n, 2), of each observation."""

    def change(line: Line) -> None:
        for seen in line["observations"]:
            seen["pixels"] = np.asarray(of(np.array(seen["pixels"]))).tolist()

    return each_line(change)


def paired_late(by: int, robot: str | None = None) -> Change:
    """Pair observations, or the states of a robot, with a later sample; samples without a partner are removed."""
    key = "observations" if robot is None else "robots"

    def of(lines: list[Line]) -> list[Line]:
        taken = [line[key] if robot is None else line[key][robot] for line in lines]
        for line, other in zip(lines[by:], taken, strict=False):
            if robot is None:
                line[key] = other
            else:
                line[key][robot] = other
        return lines[by:]

    return all_lines(of)


def exchanged(line: Line) -> None:
    """Exchange the poses of both robots."""
    robots = line["robots"]
    robots["eye"], robots["hand"] = robots["hand"], robots["eye"]
