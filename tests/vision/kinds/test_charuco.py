"""Tests of the detection of ChArUco boards in poor images."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.charuco import charuco_target
from basecal.errors import InputError
from basecal.vision.draw.render import RenderSettings
from basecal.vision.kinds.charuco import _detect_rough, detect
from basecal.vision.kinds.preprocessing import MARKER_PREPROCESSINGS
from vision_scenes import BLURRED, DARK, TARGETS, errors_of, scene, shrunk

BOARD = TARGETS["charuco"]
# Images, pixels binned into one, and corners found. Without further preprocessing the last three give none, seven
# and none.
POOR = {
    "as it should be": (RenderSettings(), 1, 24),
    "dark": (DARK, 1, 24),
    "blurred": (BLURRED, 1, 20),
    "small": (RenderSettings(), 5, 8),
}


@pytest.mark.journey
@pytest.mark.parametrize("how", list(POOR))
def test_charuco_is_detected_in_poor_images(how: str) -> None:
    """A dark, blurred or small board is detected, with sigmas true within a factor of two and a half."""
    settings, block, count = POOR[how]
    found = detect(shrunk(scene(BOARD, settings), block), BOARD)
    error = errors_of(found, BOARD, block)
    assert found is not None
    assert len(error) >= count
    assert 0.4 < np.sqrt(np.mean((error / found.sigma_px[:, None]) ** 2)) < 2.5


def test_board_of_other_dictionary_is_not_detected() -> None:
    """A board of another dictionary is not detected."""
    assert detect(scene(BOARD), charuco_target((5, 7), 0.04, 0.03, "DICT_6X6_50")) is None


def test_board_beyond_its_dictionary_is_refused() -> None:
    """A board that requires more markers than its dictionary has is an input error."""
    with pytest.raises(InputError, match="DICT_4X4_50 has 50 markers, a 20x20 board needs 200"):
        detect(scene(BOARD), charuco_target((20, 20), 0.04, 0.03, "DICT_4X4_50"))


def test_markers_beyond_stated_board_are_ignored() -> None:
    """Markers of the dictionary beyond those of the stated board are ignored."""
    found = detect(scene(BOARD), charuco_target((5, 5), 0.04, 0.03, "DICT_4X4_50"))
    assert found is not None
    assert len(found.ids) == 16


@pytest.mark.parametrize("lacking", ["corners", "markers"])
def test_incomplete_opencv_reading_is_empty(lacking: str) -> None:
    """Markers without a corner between them, or corners without markers, give an empty reading."""

    class Detector:
        """Detector that returns half of a reading."""

        def detectBoard(self, _):
            some, ids = np.zeros((1, 1, 2)), np.zeros((1, 1))
            return (None, None, some, ids) if lacking == "corners" else (some, ids, None, None)

    found = _detect_rough(Detector(), np.zeros((8, 8), np.uint8), MARKER_PREPROCESSINGS[0])
    assert (len(found), len(found.marker_ids), len(found.markers)) == (0, 0, 0)
