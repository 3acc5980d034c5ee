"""The true size of a target in the field that states it."""

import pytest

from basecal.accuracy.phrases.target_length import as_written
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("charuco", ": square_m would be 0.06"),
        ("aprilgrid", ": tag_m would be 0.084"),
        ("circles", ": spacing_m would be 0.06"),
        ("pose", ""),
    ],
)
def test_the_true_size_is_stated_in_the_targets_own_field(target, said):
    """The field of cell.yaml that gives a board its size, of whatever kind it is."""
    cell = simulate(Scenario(target=target, samples=1, pixel_px=0.0), 0).cell
    (name,) = cell.targets
    assert as_written(cell, name, 2.0) == said
