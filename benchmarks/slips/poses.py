"""Slips in tables of poses."""

from __future__ import annotations

import numpy as np
from openpyxl import Workbook
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3
from benchmarks.slips.desk import (
    KUKA_HEADER,
    MATRIX_HEADER,
    SAMPLES,
    UR_HEADER,
    Desk,
    change_frames,
    csv_rows,
    import_poses,
    kuka_rows,
    matrix_rows,
    ur_rows,
)

INCH_M = 0.0254
SHIFT = SE3(Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), np.array([0.03, -0.05, 0.12]))


def rpy_as_rotvec(desk: Desk) -> None:
    """Write roll, pitch, yaw in radians in place of rotation vectors."""
    positions, turns = desk.ur
    desk.write("ur.csv", [UR_HEADER, *csv_rows(np.c_[positions, turns.as_euler("xyz")], 6)])


def reversed_angles(desk: Desk) -> None:
    """Write the angles as C, B, A, without a header."""
    positions, turns = desk.kuka
    desk.write("kuka.csv", csv_rows(np.c_[1e3 * positions, turns.as_euler("ZYX", degrees=True)[:, ::-1]], 4))


def as_fanuc(desk: Desk) -> None:
    """Import the table without a header with `--format fanuc`."""
    desk.write("kuka.csv", kuka_rows(*desk.kuka))
    desk.steps[1] = import_poses("kuka", "fanuc")


def kuka_as_ur(desk: Desk) -> None:
    """Import the KUKA's table without a header with `--format ur`."""
    desk.write("kuka.csv", kuka_rows(*desk.kuka))
    desk.steps[1] = import_poses("kuka", "ur")


def ur_as_kuka(desk: Desk) -> None:
    """Import the UR's table without a header with `--format kuka`."""
    desk.write("ur.csv", ur_rows(*desk.ur))
    desk.steps[0] = import_poses("ur", "kuka")


def transposed(desk: Desk) -> None:
    """Write all matrices transposed."""
    desk.write("ur.csv", [MATRIX_HEADER, *matrix_rows(*desk.ur, is_by_column=True)])
    desk.steps[0] = import_poses("ur", "matrix")


def sorted_as_text(desk: Desk) -> None:
    """Sort the rows by their number as text, as a shell lists files."""
    order = sorted(range(1, SAMPLES + 1), key=str)
    rows = kuka_rows(*desk.kuka)
    desk.write("kuka.csv", [KUKA_HEADER, *(rows[number - 1] for number in order)])


def two_exchanged(desk: Desk) -> None:
    """Exchange two neighbouring rows."""
    rows, index = kuka_rows(*desk.kuka), 5 + desk.draw
    rows[index], rows[index + 1] = rows[index + 1], rows[index]
    desk.write("kuka.csv", [KUKA_HEADER, *rows])


def two_axes(desk: Desk) -> None:
    """Exchange two axes of the positions."""
    positions, turns = desk.kuka
    order = ([1, 0, 2], [2, 1, 0], [0, 2, 1])[desk.draw % 3]
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(positions[:, order], turns)])


def wrong_sign(desk: Desk) -> None:
    """Change the sign of an axis of the positions."""
    positions, turns = desk.kuka
    signs = np.where(np.arange(3) == desk.draw % 3, -1, 1)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(signs * positions, turns)])


def same_file(desk: Desk) -> None:
    """Import the UR's poses as the KUKA's."""
    desk.steps[1] = import_poses("kuka", "ur", "ur.csv")


def tool_changed(desk: Desk) -> None:
    """Change the tool frame at about the ninth row."""
    poses = change_frames(desk.kuka, slice(8 - desk.draw % 2, None), None, SHIFT)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*poses)])


def base_changed(desk: Desk) -> None:
    """Change the base frame at about the ninth row."""
    poses = change_frames(desk.kuka, slice(8 - desk.draw % 2, None), SHIFT, None)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*poses)])


def one_frame(desk: Desk) -> None:
    """Record the KUKA's poses in the UR's base frame, apart from some millimetres."""
    (base,) = desk.truth.values()
    offset = SE3(np.eye(3), np.array([0.016, 0, 0])).inverse() @ base
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*change_frames(desk.kuka, slice(None), offset, None))])
    desk.truth = {"ur_base_from_kuka_base": base @ offset.inverse()}


def few_rows_in_mm(desk: Desk) -> None:
    """Write two rows of the UR in millimetres."""
    positions = desk.ur[0].copy()
    positions[[4, 11 - desk.draw]] *= 1e3
    desk.write("ur.csv", [UR_HEADER, *ur_rows(positions, desk.ur[1])])


def decimal_commas(desk: Desk) -> None:
    """Write decimal commas between separating commas."""
    desk.write("ur.csv", [UR_HEADER, *(row.replace(".", ",") for row in ur_rows(*desk.ur))])


def thousands(desk: Desk) -> None:
    """Write millimetres with thousands separators, as a spreadsheet of the United States does, separated by tabs."""
    positions, turns = desk.kuka
    values = np.c_[1e3 * positions, turns.as_euler("ZYX", degrees=True)]
    values[:, 2] += 1000.0  # a stand under the base, so that some lengths are beyond a metre
    rows = ["\t".join(f"{value:,.3f}" for value in row) for row in values]
    desk.write("kuka.csv", ["\t".join(KUKA_HEADER.split(",")), *rows])


def excel(desk: Desk) -> None:
    """Write the numbers into the first sheet of a workbook."""
    book = Workbook()
    book.worksheets[0].append(KUKA_HEADER.split(","))
    for row in kuka_rows(*desk.kuka):
        book.worksheets[0].append([float(cell) for cell in row.split(",")])
    book.save(desk.folder / "kuka.xlsx")
    desk.steps[1] = import_poses("kuka", "kuka", "kuka.xlsx")


def image_of_matrices(desk: Desk) -> None:
    """Write each matrix beside the name of its image."""
    names = [path.name for path in desk.photos]
    rows = [f"{name},{row}" for name, row in zip(names, matrix_rows(*desk.ur), strict=True)]
    desk.write("ur.csv", [f"image,{MATRIX_HEADER}", *rows])
    desk.steps[0] = import_poses("ur", "matrix")


def franka_by_rows(desk: Desk) -> None:
    """Write matrices by rows, and import them in a format by columns."""
    desk.write("ur.csv", matrix_rows(*desk.ur))
    desk.steps[0] = import_poses("ur", "franka")


def inches(desk: Desk) -> None:
    """Write positions in inches."""
    positions, turns = desk.kuka
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(1e-3 * positions / INCH_M, turns)])
