"""What every kind of target is made of."""

from __future__ import annotations

from itertools import combinations
from textwrap import dedent

import numpy as np
import pytest

from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.kind import (
    Described,
    TargetEntry,
    TargetKind,
    choose_dictionary,
    is_indistinguishable,
    plane_grid,
)
from basecal.cell.targets.registry import TARGETS, TargetKindName


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


def test_the_next_of_several_is_another() -> None:
    """What was said is the first, then what is usual without it; of too few the last."""
    assert [choose_dictionary(("a", "b", "c"), "b", place) for place in range(4)] == ["b", "a", "c", "c"]


@pytest.mark.parametrize("name", TARGETS)
def test_several_of_a_kind(name: TargetKindName) -> None:
    """Images tell those with marks of their own apart; a cell reads each of them, and the first is as it was."""
    kind = TARGETS[name]
    fields = parse_yaml(dedent(kind.template), name).data
    several = [kind.another(fields, place) for place in range(8)]
    assert several[0] == fields
    for each in several:
        entry = kind.entries[kind.entry_index(each)]
        assert entry.model_validate({"on": "hand", **each}).shape() is not None
    told = [not is_indistinguishable(kind, one, other) for one, other in combinations(several, 2)]
    assert any(told) == told[0] == (several[1] != several[0])
