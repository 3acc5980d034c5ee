"""Tests of the messages for problems of a file."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.cell.schema.cell_schema import CellEntry
from basecal.cell.schema.errors import check_entry, check_schema, collect_problems, first_problem
from basecal.errors import DatasetError
from basecal.fields.problems import field_name

DATA = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}}


def problems(**changed):
    with pytest.raises(ValidationError) as caught:
        CellEntry.model_validate(DATA | changed)
    return {field_name(p.loc): p.message for p in collect_problems(caught.value, CellEntry)}


def target(**fields):
    return {"targets": {"it": {"on": "arm", **fields}}}


@pytest.mark.parametrize(
    ("changed", "field", "message"),
    [
        (
            {"robots": {"arm": {"noize": 1}}},
            "robots.arm.noize",
            "unknown field (did you mean 'noise'?); known: noise, urdf",
        ),
        ({"robot": {}}, "robot", "unknown field (did you mean 'robots'?); known: schema, reference, robots"),
        (target(kind="led", poinst_m=[]), "targets.it.poinst_m", "unknown field (did you mean 'points_m'?); known: on"),
        (target(kind="chesboard"), "targets.it.kind", "no kind 'chesboard' (did you mean 'chessboard'?); there are: "),
        (target(kind=5), "targets.it.kind", "no kind 5; there are: charuco"),
        (target(kind="chessboard", corners=[3, 3]), "targets.it.square_m", "missing; add it"),
        ({"<b>": 1}, "<b>", "unknown field; known: schema, reference"),
        ({"robots": []}, "robots", "expected a mapping `{name: ...}`, got a list of 0"),
        ({"robots": {"arm": 5}}, "robots.arm", "expected a mapping `{field: value}`, got 5"),
        ({"reference": 5}, "reference", "expected text, got 5"),
        (
            {"noise": {"correlated_px": 1.0}},
            "noise",
            "correlated_px needs pixel_px: state the noise of single points too",
        ),
        (target(kind="led", points_m=[["a", 0, 0]]), "targets.it.points_m[0][0]", "expected a number, got 'a'"),
        (target(kind="chessboard", corners=[3.5, 3], square_m=1.0), "targets.it.corners[0]", "a whole number, got 3.5"),
        (
            target(kind="chessboard", corners=[1, 3], square_m=1.0),
            "targets.it.corners[0]",
            "greater than or equal to 2",
        ),
        ({"cameras": {"eye": {"on": "arm", "mount": {"guess": {"t": 1}}}}}, "cameras.eye.mount.guess.t", "known: t_m"),
    ],
)
def test_messages_name_field_and_expected_value(changed, field, message):
    """A message states the place, the expected value, the actual value and the nearest known name."""
    found = problems(**changed)
    assert list(found) == [field]
    assert message in found[field]


def test_all_problems_are_reported():
    """All problems of a file are reported at once."""
    assert set(problems(reference=5, **target(kind="x"))) == {"reference", "targets.it.kind"}


def test_nested_entry_errors_state_full_location():
    """The error of an entry inside a file states the entry's place before the field's, and the entry's line."""
    with pytest.raises(DatasetError) as caught:
        check_entry(CellEntry, {"reference": 3}, "cell.yaml", {("cells", 0): 7}, loc=("cells", 0))
    assert (caught.value.line, caught.value.field) == (7, "cells[0].reference")
    with pytest.raises(ValidationError) as invalid:
        CellEntry.model_validate({"schema": "basecal/cell/1", "reference": 3, "robots": {}})
    assert first_problem(invalid.value, CellEntry) == "reference: expected text, got 3"


@pytest.mark.parametrize(("data", "got"), [([1], "a list of 1"), ({}, "none"), ({"schema": "b/2"}, "'b/2'")])
def test_other_schema_is_refused(data, got):
    """The error for another schema states the expected and the actual one."""
    assert check_schema({"schema": "b/1"}, "b/1", "file", {}) == {"schema": "b/1"}
    with pytest.raises(DatasetError, match=f"expected .*b/1.*, got {got}"):
        check_schema(data, "b/1", "file", {})
