"""Slips in photographs, and in what is said of them."""

from __future__ import annotations

import cv2
import numpy as np
from tests.journeys.raw import BOARD, LENS

from basecal.geometry import SE3, Array
from basecal.simulation.images import camera_from_target
from basecal.vision.draw.render import render
from benchmarks.slips.desk import UR_HEADER, Desk, import_images, ur_rows

ASIDE = SE3(np.eye(3), np.array([0.17, 0.0, 0.0]))  # a second print beside the first


def mirrored(desk: Desk) -> None:
    """As a webcam's program shows them."""
    for path in desk.photos:
        _save(path, _read(path)[:, ::-1])


def second_board(desk: Desk) -> None:
    """A second print of the board hangs beside the first."""
    (camera,), (target,) = desk.made.cell.cameras, desk.made.cell.targets
    for index, path in enumerate(desk.photos):
        seen = camera_from_target(desk.made, camera, target, index)
        beside = render(LENS, BOARD, seen @ ASIDE, None, index)
        alone = _read(path)
        _save(path, np.where(_is_board(seen @ ASIDE), beside, alone))


def _is_board(seen: SE3) -> Array:
    """Pixels that a board covers."""
    width, height = LENS.size_px or (0, 0)
    corners = np.array([[-0.01, -0.01, 0], [0.16, -0.01, 0], [0.16, 0.22, 0], [-0.01, 0.22, 0]])
    pixels = LENS.project(seen @ corners)
    mask = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(mask, np.round(np.nan_to_num(pixels, nan=-1e4)).astype(np.int32), 1)
    return mask.astype(bool)


def as_chessboard(desk: Desk) -> None:
    """Its inner corners counted, its markers overlooked."""
    desk.steps[2] = import_images(options="--target chessboard --corners 4x6 --square 30mm")


def bild(desk: Desk) -> None:
    """The table names its images, and has its rows in the order in which they were written down."""
    rows = [f"{path.name};{row}" for path, row in zip(desk.photos, _semicolons(desk), strict=True)]
    turned = np.random.default_rng(desk.draw).permutation(len(rows))
    desk.write("ur.csv", ["Bild;" + UR_HEADER.replace(",", ";"), *rows])
    kuka = (desk.folder / "kuka.csv").read_text().splitlines()
    named = [f"{path.name},{row}" for path, row in zip(desk.photos, kuka[1:], strict=True)]
    desk.write("kuka.csv", [f"Bild,{kuka[0]}", *(named[k] for k in turned)])


def _semicolons(desk: Desk) -> list[str]:
    return [row.replace(",", ";").replace(".", ",") for row in ur_rows(*desk.ur)]


def missing(desk: Desk) -> None:
    """The seventh was deleted, being blurred."""
    desk.photos[6].unlink()


def _read(path: object) -> Array:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))


def _save(path: object, image: Array) -> None:
    """A file of its own: that of other slips stays."""
    from pathlib import Path

    Path(str(path)).unlink()
    cv2.imwrite(str(path), np.ascontiguousarray(image))
