"""Slips in tables of poses."""

from __future__ import annotations

from zipfile import ZipFile

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3
from benchmarks.slips.desk import (
    KUKA_HEADER,
    MATRIX_HEADER,
    SAMPLES,
    UR_HEADER,
    Desk,
    csv_rows,
    import_poses,
    kuka_rows,
    matrix_rows,
    moved,
    ur_rows,
)

INCH_M = 0.0254
SHIFT = SE3(Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), np.array([0.03, -0.05, 0.12]))
_SHEET = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


def rpy_as_rotvec(desk: Desk) -> None:
    """The pendant shows RPY in radians."""
    positions, turns = desk.ur
    desk.write("ur.csv", [UR_HEADER, *csv_rows(np.c_[positions, turns.as_euler("xyz")], 6)])


def reversed_angles(desk: Desk) -> None:
    """C, B, A without a header."""
    positions, turns = desk.kuka
    desk.write("kuka.csv", csv_rows(np.c_[1e3 * positions, turns.as_euler("ZYX", degrees=True)[:, ::-1]], 4))


def as_fanuc(desk: Desk) -> None:
    """Without a header, and `--format fanuc`."""
    desk.write("kuka.csv", kuka_rows(*desk.kuka))
    desk.steps[1] = import_poses("kuka", "fanuc")


def kuka_as_ur(desk: Desk) -> None:
    """The KUKA's file without a header, and `--format ur`."""
    desk.write("kuka.csv", kuka_rows(*desk.kuka))
    desk.steps[1] = import_poses("kuka", "ur")


def ur_as_kuka(desk: Desk) -> None:
    """The UR's file without a header, and `--format kuka`."""
    desk.write("ur.csv", ur_rows(*desk.ur))
    desk.steps[0] = import_poses("ur", "kuka")


def transposed(desk: Desk) -> None:
    """All of the 4x4."""
    desk.write("ur.csv", [MATRIX_HEADER, *matrix_rows(*desk.ur, is_by_column=True)])
    desk.steps[0] = import_poses("ur", "matrix")


def sorted_as_text(desk: Desk) -> None:
    """Files of one pose each, joined as a shell lists them."""
    order = sorted(range(1, SAMPLES + 1), key=str)
    rows = kuka_rows(*desk.kuka)
    desk.write("kuka.csv", [KUKA_HEADER, *(rows[number - 1] for number in order)])


def two_exchanged(desk: Desk) -> None:
    """Two rows side by side."""
    rows, at = kuka_rows(*desk.kuka), 5 + desk.draw
    rows[at], rows[at + 1] = rows[at + 1], rows[at]
    desk.write("kuka.csv", [KUKA_HEADER, *rows])


def two_axes(desk: Desk) -> None:
    """Of the positions."""
    positions, turns = desk.kuka
    order = ([1, 0, 2], [2, 1, 0], [0, 2, 1])[desk.draw % 3]
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(positions[:, order], turns)])


def wrong_sign(desk: Desk) -> None:
    """Of the positions."""
    positions, turns = desk.kuka
    signs = np.where(np.arange(3) == desk.draw % 3, -1, 1)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(signs * positions, turns)])


def same_file(desk: Desk) -> None:
    """The UR's poses as the KUKA's."""
    desk.steps[1] = import_poses("kuka", "ur", "ur.csv")


def tool_changed(desk: Desk) -> None:
    """From the ninth row on."""
    poses = moved(desk.kuka, slice(8 - desk.draw % 2, None), None, SHIFT)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*poses)])


def base_changed(desk: Desk) -> None:
    """From the ninth row on."""
    poses = moved(desk.kuka, slice(8 - desk.draw % 2, None), SHIFT, None)
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*poses)])


def one_frame(desk: Desk) -> None:
    """The KUKA's `$BASE` is the UR's base, but for some millimetres."""
    (base,) = desk.truth.values()
    near = SE3(np.eye(3), np.array([0.016, 0, 0])).inverse() @ base
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*moved(desk.kuka, slice(None), near, None))])
    desk.truth = {"ur_base_from_kuka_base": base @ near.inverse()}


def few_rows_in_mm(desk: Desk) -> None:
    """Two rows of the UR."""
    positions = desk.ur[0].copy()
    positions[[4, 11 - desk.draw]] *= 1e3
    desk.write("ur.csv", [UR_HEADER, *ur_rows(positions, desk.ur[1])])


def decimal_commas(desk: Desk) -> None:
    """Between commas."""
    desk.write("ur.csv", [UR_HEADER, *(row.replace(".", ",") for row in ur_rows(*desk.ur))])


def thousands(desk: Desk) -> None:
    """Millimetres as a spreadsheet of the United States shows them, separated by tabs."""
    positions, turns = desk.kuka
    values = np.c_[1e3 * positions, turns.as_euler("ZYX", degrees=True)]
    values[:, 2] += 1000.0  # a stand under the base, so that some lengths are beyond a metre
    rows = ["\t".join(f"{value:,.3f}" for value in row) for row in values]
    desk.write("kuka.csv", ["\t".join(KUKA_HEADER.split(",")), *rows])


def excel(desk: Desk) -> None:
    """Numbers in the first sheet of a workbook, texts inline."""
    rows = [KUKA_HEADER.split(","), *(row.split(",") for row in kuka_rows(*desk.kuka))]
    lines = "".join(f"<row>{''.join(map(_cell, row))}</row>" for row in rows)
    with ZipFile(desk.folder / "kuka.xlsx", "w") as archive:
        sheet = f"<worksheet {_SHEET}><sheetData>{lines}</sheetData></worksheet>"
        archive.writestr("xl/worksheets/sheet1.xml", sheet)
    desk.steps[1] = import_poses("kuka", "kuka", "kuka.xlsx")


def _cell(text: str) -> str:
    return f'<c t="inlineStr"><is><t>{text}</t></is></c>' if text.isalpha() else f"<c><v>{text}</v></c>"


def image_of_matrices(desk: Desk) -> None:
    """Rows in another order, each beside the name of its image."""
    names = [path.name for path in desk.photos]
    rows = [f"{name},{row}" for name, row in zip(names, matrix_rows(*desk.ur), strict=True)]
    desk.write("ur.csv", [f"image,{MATRIX_HEADER}", *rows])
    desk.steps[0] = import_poses("ur", "matrix")


def franka_by_rows(desk: Desk) -> None:
    """To a format by columns."""
    desk.write("ur.csv", matrix_rows(*desk.ur))
    desk.steps[0] = import_poses("ur", "franka")


def inches(desk: Desk) -> None:
    """A KUKA whose program was exported in inches."""
    positions, turns = desk.kuka
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(1e-3 * positions / INCH_M, turns)])
