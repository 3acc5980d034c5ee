"""Lenses as files state them, and as `cell.yaml` has them."""

from __future__ import annotations

import pytest

from basecal.errors import DatasetError
from basecal.exchange.fields import parse_fields
from basecal.exchange.lens_files.stated_lens import (
    OPENCV_TERMS,
    camera_entry,
    made_camera,
    matrix_parameters,
    opencv_terms,
)
from basecal.geometry.lenses.registry import model_lenses

HERE = parse_fields("k: 1", "a.yaml").find("k")


def test_terms_are_those_of_the_lenses_there_are() -> None:
    """The numbers of terms that are read are those that a pinhole may have."""
    assert tuple(sorted({count for lens in model_lenses("pinhole") for count in lens.TERMS})) == OPENCV_TERMS


def test_a_sensor_that_is_not_tilted_needs_no_tilt() -> None:
    """Fourteen terms whose last two are zero are twelve; others, and odd numbers of them, are refused."""
    assert opencv_terms(HERE, [0.1] * 12 + [0.0, 0.0]) == [0.1] * 12
    with pytest.raises(DatasetError, match=r"a.yaml:1: k: the last two of 14 terms tilt the sensor"):
        opencv_terms(HERE, [0.1] * 14)
    with pytest.raises(DatasetError, match="has 6 distortion terms, expected 0 or 4 or 5 or 8 or 12 or 14"):
        opencv_terms(HERE, [0.1] * 6)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([0, 0, 0, 0, 0, 0, 0, 0, 0], "the camera is not calibrated"),
        ([500, 0, 0, 0, 500, 0, 320, 240, 1], "is it transposed"),
        ([500, 1, 320, 0, 500, 240, 0, 0, 1], "a skew of 1 px"),
    ],
)
def test_no_camera_matrix_is_told(matrix: list[float], message: str) -> None:
    """Zeros, as ROS has them of cameras that are not calibrated; columns for rows; a skew."""
    with pytest.raises(DatasetError, match=message):
        matrix_parameters(HERE, [float(value) for value in matrix])


def test_a_lens_as_the_cell_has_it() -> None:
    """Model, size, status, focal lengths, centre and terms; no lens is told at its place."""
    camera = made_camera(HERE, "pinhole", [500, 501, 320, 240, 0.1, 0, 0, 0], (640, 480))
    assert camera_entry(camera, "fixed") == {
        "model": "pinhole",
        "size_px": [640, 480],
        "intrinsics": {"status": "fixed", "fx": 500, "fy": 501, "cx": 320, "cy": 240, "distortion": [0.1, 0, 0, 0]},
    }
    with pytest.raises(DatasetError, match=r"a.yaml:1: k: the focal lengths are -500"):
        made_camera(HERE, "pinhole", [-500, 500, 320, 240], None)
