"""Tests of the parts shared by every kind of target."""

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


def test_plane_grid_runs_row_by_row():
    """X runs along columns and y along rows, both from the origin, in the plane z = 0."""
    np.testing.assert_allclose(
        plane_grid(3, 2, 0.5, origin=1.0),
        [[1, 1, 0], [1.5, 1, 0], [2, 1, 0], [1, 1.5, 0], [1.5, 1.5, 0], [2, 1.5, 0]],
    )
    np.testing.assert_allclose(plane_grid(2, 1, 0.5), [[0, 0, 0], [0.5, 0, 0]])


def test_target_without_kind_has_no_points():
    """A target without a kind is observed only as poses; its mount is free by default."""
    entry = TargetEntry.model_validate({"on": "hand"})
    assert entry.shape() is None
    assert entry.mount.status == "free"


def test_kind_uses_first_entry_by_default():
    """A kind reads fields by its first entry by default, and has no printed form."""
    kind = TargetKind((TargetEntry,), KindDescription("", "", ""), "", lambda _: None)
    assert kind.entry_index({"anything": 1}) == 0
    assert kind.printed is None


def test_dictionary_choice_by_place() -> None:
    """The stated dictionary is first, then the usual ones without it; beyond the end the last is repeated."""
    assert [choose_dictionary(("a", "b", "c"), "b", place) for place in range(4)] == ["b", "a", "c", "c"]


@pytest.mark.parametrize("name", TARGETS)
def test_numbered_targets_of_a_kind_are_valid(name: TargetKindName) -> None:
    """Numbered targets of a kind are all valid and the first is unchanged.

    Those with marks can be distinguished in images.
    """
    kind = TARGETS[name]
    fields = parse_yaml(dedent(kind.template), name).data
    several = [kind.numbered_fields(fields, place) for place in range(8)]
    assert several[0] == fields
    for each in several:
        entry = kind.entries[kind.entry_index(each)]
        assert entry.model_validate({"on": "hand", **each}).shape() is not None
    distinguishable = [not is_indistinguishable(kind, one, other) for one, other in combinations(several, 2)]
    assert any(distinguishable) == distinguishable[0] == (several[1] != several[0])


@pytest.mark.parametrize("fields", [{"exact": True}, {"size_sigma": 1e-3}, {"kind": "led"}])
def test_free_scale_is_for_pose_targets_only(fields: dict[str, object]) -> None:
    """A free scale excludes a kind, an exact size and a size sigma."""
    model = TARGETS["led"].entries[0] if "kind" in fields else TargetEntry
    assert TargetEntry.model_validate({"on": "hand", "scale": "free"}).scale == "free"
    assert model.model_validate({"on": "hand", **fields}).scale is None
    with pytest.raises(ValidationError, match="scale is for a target that is seen only as poses: remove kind, exact"):
        model.model_validate({"on": "hand", "scale": "free", **fields})


def test_exact_size_takes_no_sigma() -> None:
    """`exact` excludes `size_sigma`, and a target is not exact by default."""
    assert not TargetEntry.model_validate({"on": "hand", "size_sigma": 1e-3}).exact
    with pytest.raises(ValidationError, match="exact takes no size_sigma: remove one of them"):
        TargetEntry.model_validate({"on": "hand", "exact": True, "size_sigma": 1e-3})


def test_targets_with_shared_or_no_marks_are_indistinguishable() -> None:
    """Targets with disjoint marks are distinguishable; one shared mark or none on both makes them indistinguishable."""
    kind = TargetKind((TargetEntry,), KindDescription("", "", ""), "", lambda _: None)
    assert is_indistinguishable(kind, {"n": 1}, {"n": 2})
    assert kind.numbered_fields({"n": 1}, 3) == {"n": 1}
    marked = replace(kind, marks=lambda fields: frozenset(fields["n"]))
    cases = (("ab", "cd", False), ("ab", "bc", True), ("ab", "", False), ("", "ab", False), ("", "", True))
    for first, second, expected in cases:
        assert is_indistinguishable(marked, {"n": first}, {"n": second}) == expected
