"""What carries a camera and a target that a table of poses names."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, CellTarget, PoseObservation, Robot
from basecal.errors import InputError
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.seen_poses import Sight, seen_rows, sight_entry
from basecal.geometry import SE3

ONE = Cell("arm", {"arm": Robot("arm")}, {}, {}, {})
TWO = Cell("a", {"a": Robot("a"), "b": Robot("b")}, {}, {}, {})
FULL = Cell("a", TWO.robots, {}, {"eye": CellCamera("eye", "a")}, {"tag": CellTarget("tag", "b")})


@pytest.mark.parametrize(
    ("cell", "sight", "carriers"),
    [
        (None, Sight("eye", "tag", "left"), ("left", "world")),
        (ONE, Sight("eye", "tag"), ("arm", "world")),
        (ONE, Sight("eye", "tag", "world"), ("world", "arm")),
        (TWO, Sight("eye", "tag", "a", "b"), ("a", "b")),
        (TWO, Sight("eye", "tag", "world", "b"), ("world", "b")),
    ],
)
def test_carriers(cell: Cell | None, sight: Sight, carriers: tuple[str, str]) -> None:
    entry = sight_entry(cell, sight)
    assert (entry["cameras"]["eye"]["on"], entry["targets"]["tag"]["on"]) == carriers
    assert set(entry["robots"]) == set(carriers) - {"world"}


def test_what_the_cell_says_stays() -> None:
    assert sight_entry(FULL, Sight("eye", "tag"))["cameras"] == {"eye": {}}


@pytest.mark.parametrize(
    ("cell", "sight", "said"),
    [
        (TWO, Sight("eye", "tag"), "--on with one of: a, b, world"),
        (TWO, Sight("eye", "tag", "world"), "--target-on with one of: a, b, world"),
        (None, Sight("eye", "tag"), "--on with one of: a robot or world"),
        (FULL, Sight("eye", "tag", "b"), "camera 'eye' is on 'a' in cell.yaml, not on 'b'"),
        (FULL, Sight("eye", "tag", None, "world"), "target 'tag' is on 'b' in cell.yaml, not on 'world'"),
        (ONE, Sight("eye", "tag", "arm", "arm"), "both on 'arm'"),
    ],
)
def test_what_is_not_clear_is_an_error(cell: Cell | None, sight: Sight, said: str) -> None:
    with pytest.raises(InputError, match=said):
        sight_entry(cell, sight)


def test_each_row_gets_its_view() -> None:
    poses = SE3.exp(np.random.default_rng(0).normal(0, 0.3, (2, 6)))
    found = seen_rows((Row(stamp_s=1.0), Row(stamp_s=2.0)), poses, Sight("eye", "tag"))
    assert [row.stamp_s for row in found] == [1.0, 2.0]
    view = found[1].observations[0]
    assert isinstance(view, PoseObservation)
    np.testing.assert_array_equal(view.camera_from_target.matrix, poses[1].matrix)
