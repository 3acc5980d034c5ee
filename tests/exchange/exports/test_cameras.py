"""Tests of the choice of the exported lens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CellCamera, Intrinsics
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.cameras import choose_camera, exported_camera
from basecal.exchange.exports.exporter import ExportRequest
from basecal.geometry import Camera
from export_example import CALIBRATION, CELL

LENS = Camera("pinhole", np.array([800, 801, 320, 240, -0.1, 0.01, 0, 0, 0]), (640, 480))
OTHER = Camera("fisheye", np.array([300, 301, 320, 240, 0.1, 0.01, 0, 0]))
ESTIMATED = replace(CALIBRATION, cameras={"wrist": (LENS, np.eye(9))})


def cell_with_lens(intrinsics):
    """Return a cell with a second camera whose lens has these intrinsics."""
    top = CellCamera("top", "world", size_px=(100, 50), intrinsics=intrinsics)
    return replace(CELL, cameras={**CELL.cameras, "top": top})


def test_estimated_lens_precedes_stated_one():
    """A stated lens has the image size of its camera."""
    both = ExportRequest((), (), ESTIMATED, cell_with_lens(Intrinsics("fixed", OTHER)))
    assert exported_camera(both, "wrist") is LENS
    assert exported_camera(both, "top").model == "fisheye"
    assert exported_camera(both, "top").size_px == (100, 50)


def test_only_camera_needs_no_name():
    """One of several cameras must be named."""
    assert choose_camera(ExportRequest((), (), ESTIMATED)) == "wrist"
    assert choose_camera(ExportRequest((), (), ESTIMATED, cell_with_lens(None), camera="top")) == "top"
    with pytest.raises(InputError, match="with --camera: wrist, top"):
        choose_camera(ExportRequest((), (), ESTIMATED, cell_with_lens(None)))


@pytest.mark.parametrize("intrinsics", [None, Intrinsics("free", OTHER), Intrinsics("free")])
def test_unknown_lens_is_refused(intrinsics):
    """A guess is not a known lens."""
    with pytest.raises(InputError, match="the lens of 'top' is not known"):
        exported_camera(ExportRequest((), (), ESTIMATED, cell_with_lens(intrinsics)), "top")
    with pytest.raises(FrameNotFound, match="no 'tap'"):
        exported_camera(ExportRequest((), (), ESTIMATED, cell_with_lens(intrinsics)), "tap")
