"""Parts of `cell.yaml` that two robots hold."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import clamp_cell, clamp_lines, held_poses, lines_text, recorded, touch_data

from basecal.cell.files import cell_from_dict, cell_to_dict, recording_from_text, sample_to_dict
from basecal.errors import DatasetError


def test_a_part_without_a_name_is_read_back():
    """It is named `part`, its ends are on both robots, and what is written is the same cell and the same samples."""
    cell = clamp_cell("free")
    assert set(cell.transforms) == {"eye_base_from_hand_base", "eye_flange_from_part", "hand_flange_from_part_grip"}
    again = cell_to_dict(cell_from_dict(cell_to_dict(cell)))
    assert again == cell_to_dict(cell)
    assert again["clamp"] == {"part": {"robots": ["eye", "hand"], "axis": "free"}}
    recording = recorded(cell, clamp_lines(held_poses(np.random.default_rng(0), 2), sigma_m=1e-4, sigma_rad=2e-3))
    written = [sample_to_dict(sample, "recording") for sample in recording.samples]
    assert written[1]["observations"] == [{"clamp": "part", "sigma_m": 1e-4, "sigma_rad": 2e-3}]
    assert [sample_to_dict(s, "recording") for s in recorded(cell, written).samples] == written


@pytest.mark.parametrize(
    ("clamp", "words"),
    [
        ({"robots": ["eye", "eye"]}, "one twice"),
        ({"robots": ["eye"]}, "at least 2"),
        ({"robots": ["eye", "arm"]}, "no robot 'arm'"),
        ({"rod": {"robots": ["eye", "hand"], "axis": "ball"}}, "axis"),
        ({"eye_tip": {"robots": ["eye", "hand"]}}, "taken by"),
        ([], "clamp"),
    ],
)
def test_mistakes_are_named(clamp, words):
    """Robots that do not exist, other axes and names that are taken are errors."""
    with pytest.raises(DatasetError, match=words):
        cell_from_dict({**touch_data(), "clamp": clamp})


def test_an_unknown_part_of_a_line_is_an_error():
    """The line names a part that the cell does not have."""
    line = {"sample": 0, "robots": {}, "observations": [{"clamp": "rod"}]}
    with pytest.raises(DatasetError, match="no clamp 'rod'"):
        recording_from_text(lines_text([line]).encode(), ".", clamp_cell("fixed"))
