"""A capture as watched by a page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import Watch
from basecal.cell import Cell, RobotState
from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3, Camera
from basecal.vision.draw.render import render
from tests.shared.facing_arms import facing_arms

LENS = Camera("pinhole", np.array([500.0, 500.0, 319.5, 239.5]), (640, 480))
BOARD = charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50")


def cell_with_a_board() -> Cell:
    """Two arms that face each other, a camera on one and a board on the other."""
    cell = facing_arms().cell
    (board,) = cell.targets.values()
    return replace(cell, targets={board.name: replace(board, target=BOARD)})


def captured(cell: Cell) -> Watch:
    """The watch of a capture after three samples, with an image of a board."""
    watch, cells = Watch(), np.zeros(COVERAGE_GRID, dtype=bool)
    cells[1, 2:4] = True
    for k in range(3):
        rotations = {"eye": np.full(3, 0.4), "hand": np.array([0.4, 0.1, 0.4])}
        watch.note(Step(k, "", 5 + k, 25, Coverage(cells, rotations), (1e-3 / (k + 1), 1e-3)))
    watch.note_image(next(iter(cell.cameras)), render(LENS, BOARD, SE3(np.eye(3), np.array([-0.1, -0.14, 0.6]))))
    for robot, joints in facing_arms().home.items():
        watch.note_state(robot, RobotState(joints_rad=joints))
    watch.note_goal("hand", RobotState(joints_rad=facing_arms().home["hand"] + 0.1))
    watch.note(Step(3, "target not seen by wrist", 7, 25, Coverage(cells, rotations), None))
    watch.note_error(5e-4, 8e-4)
    watch.notify("sample 4: arms move")
    return watch
