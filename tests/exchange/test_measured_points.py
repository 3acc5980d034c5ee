"""Tables of points in space."""

from __future__ import annotations

import pytest

from basecal.errors import DatasetError
from basecal.exchange.measured_points import PointTable


@pytest.mark.parametrize(
    ("heading", "length_m", "size", "unit"),
    [
        ("x_mm y_mm z_mm", None, 1e-3, "mm"),
        ("x_in y_in z_in", None, 0.0254, "in"),
        ("X Y Z", 1.0, 1.0, "1000 mm"),
    ],
)
def test_units_of_the_header(tmp_path, heading, length_m, size, unit):
    """Lengths are in the unit that columns name, or in the stated one."""
    (tmp_path / "a.txt").write_text(f"{heading}\n1 2 3\n4 5 6\n")
    table = PointTable.read(str(tmp_path / "a.txt"), length_m)
    assert table.unit == unit
    assert table.points_m.ravel().tolist() == pytest.approx([size * k for k in (1, 2, 3, 4, 5, 6)])


def test_two_units_are_an_error(tmp_path):
    """Nothing is guessed."""
    (tmp_path / "a.txt").write_text("x_mm y_mm z_m\n1 2 3\n")
    with pytest.raises(DatasetError, match="several units"):
        PointTable.read(str(tmp_path / "a.txt"), None)
