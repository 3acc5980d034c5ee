"""Tests of the corrected target length and its field."""

import pytest

from basecal.accuracy.phrases.target_length import corrected_length_clause, scale_lengths
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize(
    ("target", "clause"),
    [
        ("charuco", ": square_m would be 0.06"),
        ("aprilgrid", ": tag_m would be 0.084"),
        ("apriltag", ": size_m would be 0.24"),
        ("circles", ": spacing_m would be 0.06"),
        ("pose", ""),
    ],
)
def test_corrected_size_uses_targets_field(target, clause):
    """The corrected size is stated in the field of cell.yaml that gives this kind of board its size."""
    cell = simulate(Scenario(target=target, samples=1, pixel_px=0.0), 0).cell
    (name,) = cell.targets
    assert corrected_length_clause(cell, name, 2.0) == clause


def test_all_lengths_are_scaled():
    """All lengths are scaled, also those of tags in a list; ids, rotations and counts stay."""
    tag = {"id": 3, "size_m": 0.1, "t_m": [0, 0.2, 0], "q_xyzw": [0, 0, 0, 1]}
    fields = {"tags": [tag], "square_m": 0.03, "squares": [7, 5]}
    scaled = {"tags": [{**tag, "size_m": 0.12, "t_m": [0, 0.24, 0]}], "square_m": 0.036, "squares": [7, 5]}
    assert scale_lengths(fields, 1.2) == scaled
