"""What every kind of target is made of."""

from __future__ import annotations

import numpy as np

from basecal.cell.targets.kind import Described, TargetEntry, TargetKind, plane_grid


def test_grids_run_row_by_row():
    """X along columns, y along rows, both from the origin, in the plane z = 0."""
    np.testing.assert_allclose(
        plane_grid(3, 2, 0.5, origin=1.0),
        [[1, 1, 0], [1.5, 1, 0], [2, 1, 0], [1, 1.5, 0], [1.5, 1.5, 0], [2, 1.5, 0]],
    )
    np.testing.assert_allclose(plane_grid(2, 1, 0.5), [[0, 0, 0], [0.5, 0, 0]])


def test_a_target_without_a_kind_has_no_points():
    """It is seen only as poses, with a free mount unless stated."""
    entry = TargetEntry.model_validate({"on": "hand"})
    assert entry.shape() is None
    assert entry.mount.status == "free"


def test_a_kind_reads_by_its_first_entry():
    """Unless it says otherwise."""
    kind = TargetKind((TargetEntry,), Described("", "", ""), "", lambda _: None)
    assert kind.entry_index({"anything": 1}) == 0
    assert kind.printed is None
