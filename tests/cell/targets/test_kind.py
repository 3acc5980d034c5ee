"""What every kind of target is made of."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from textwrap import dedent

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.kind import (
    KindDescription,
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
    kind = TargetKind((TargetEntry,), KindDescription("", "", ""), "", lambda _: None)
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
    several = [kind.numbered_fields(fields, place) for place in range(8)]
    assert several[0] == fields
    for each in several:
        entry = kind.entries[kind.entry_index(each)]
        assert entry.model_validate({"on": "hand", **each}).shape() is not None
    told = [not is_indistinguishable(kind, one, other) for one, other in combinations(several, 2)]
    assert any(told) == told[0] == (several[1] != several[0])


@pytest.mark.parametrize("fields", [{"exact": True}, {"size_sigma": 1e-3}, {"kind": "led"}])
def test_a_free_scale_is_of_poses_alone(fields: dict[str, object]) -> None:
    """No kind, exact sizes or sigma of sizes go with it."""
    model = TARGETS["led"].entries[0] if "kind" in fields else TargetEntry
    assert TargetEntry.model_validate({"on": "hand", "scale": "free"}).scale == "free"
    assert model.model_validate({"on": "hand", **fields}).scale is None
    with pytest.raises(ValidationError, match="scale is for a target that is seen only as poses: remove kind, exact"):
        model.model_validate({"on": "hand", "scale": "free", **fields})


def test_exact_sizes_have_no_sigma() -> None:
    """One of both is enough, and a target is not exact unless it is said."""
    assert not TargetEntry.model_validate({"on": "hand", "size_sigma": 1e-3}).exact
    with pytest.raises(ValidationError, match="exact takes no size_sigma: remove one of them"):
        TargetEntry.model_validate({"on": "hand", "exact": True, "size_sigma": 1e-3})


def test_targets_without_any_marks_cannot_be_told_apart() -> None:
    """Of different marks they can, and of one that is equal they cannot; a kind without marks has none."""
    kind = TargetKind((TargetEntry,), KindDescription("", "", ""), "", lambda _: None)
    assert is_indistinguishable(kind, {"n": 1}, {"n": 2})
    assert kind.numbered_fields({"n": 1}, 3) == {"n": 1}
    marked = replace(kind, marks=lambda fields: frozenset(fields["n"]))
    cases = (("ab", "cd", False), ("ab", "bc", True), ("ab", "", False), ("", "ab", False), ("", "", True))
    for first, second, expected in cases:
        assert is_indistinguishable(marked, {"n": first}, {"n": second}) == expected
