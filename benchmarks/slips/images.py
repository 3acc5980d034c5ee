"""Slips in photographs, and in their description."""

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
    """Mirror the images, as the program of a webcam does."""
    for path in desk.photos:
        _save(path, _read(path)[:, ::-1])


def second_board(desk: Desk) -> None:
    """Hang a second print of the board beside the first."""
    (camera,), (target,) = desk.made.cell.cameras, desk.made.cell.targets
    for index, path in enumerate(desk.photos):
        pose = camera_from_target(desk.made, camera, target, index)
        beside = render(LENS, BOARD, pose @ ASIDE, None, index)
        alone = _read(path)
        _save(path, np.where(_is_board(pose @ ASIDE), beside, alone))


def _is_board(camera_from_board: SE3) -> Array:
    """Mask of the pixels that a board covers."""
    width, height = LENS.size_px or (0, 0)
    corners = np.array([[-0.01, -0.01, 0], [0.16, -0.01, 0], [0.16, 0.22, 0], [-0.01, 0.22, 0]])
    pixels = LENS.project(camera_from_board @ corners)
    mask = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(mask, np.round(np.nan_to_num(pixels, nan=-1e4)).astype(np.int32), 1)
    return mask.astype(bool)


def as_chessboard(desk: Desk) -> None:
    """Describe the ChArUco board as a chessboard by its inner corners."""
    desk.steps[2] = import_images(options="--target chessboard --corners 4x6 --square 30mm")


def bild(desk: Desk) -> None:
    """Name the images in a column `Bild`, with the rows of one table in another order."""
    rows = [f"{path.name};{row}" for path, row in zip(desk.photos, _semicolons(desk), strict=True)]
    order = np.random.default_rng(desk.draw).permutation(len(rows))
    desk.write("ur.csv", ["Bild;" + UR_HEADER.replace(",", ";"), *rows])
    kuka = (desk.folder / "kuka.csv").read_text().splitlines()
    named = [f"{path.name},{row}" for path, row in zip(desk.photos, kuka[1:], strict=True)]
    desk.write("kuka.csv", [f"Bild,{kuka[0]}", *(named[k] for k in order)])


def _semicolons(desk: Desk) -> list[str]:
    return [row.replace(",", ";").replace(".", ",") for row in ur_rows(*desk.ur)]


def missing(desk: Desk) -> None:
    """Delete the seventh image."""
    desk.photos[6].unlink()


def _read(path: object) -> Array:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))


def _save(path: object, image: Array) -> None:
    """Write a new file in place of a link, so that the images of other desks stay."""
    from pathlib import Path

    Path(str(path)).unlink()
    cv2.imwrite(str(path), np.ascontiguousarray(image))
