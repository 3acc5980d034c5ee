"""Tests of the finding `held-out-places`: touches at held-out marks are farther off than expected."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from basecal.accuracy.cross_validation.station_scores import PlaceError
from basecal.accuracy.findings.held_out_places import held_out_places


@pytest.mark.parametrize(("ratio", "marks"), [(1.4, ("b",)), (1.05, ()), (0.5, ())])
def test_worst_mark_beyond_chance_is_named(ratio, marks):
    """The worst mark is named if its error is beyond chance, with its error and the expected one in mm.

    Errors smaller than expected give no finding.
    """
    errors = (PlaceError("a", 2e-4, 1.0, 90.0), PlaceError("b", 2.8e-4, ratio, 90.0))
    found = held_out_places(SimpleNamespace(held_out_places=errors))
    assert tuple(each.about[0] for each in found) == marks
    assert all("off by 0.28 mm; 0.20 mm is expected" in each.what for each in found)


def test_cells_without_places_have_no_finding():
    """Cells without touches, or with two places, have no finding."""
    assert held_out_places(SimpleNamespace(held_out_places=())) == []


@pytest.mark.parametrize(("freedoms", "named"), [(20.0, False), (200.0, True)])
def test_chance_limit_depends_on_touch_count(freedoms, named):
    """An error 1.3 times the expected one is beyond chance only for many touches."""
    (place,) = [PlaceError("a", 3.9e-4, 1.3, freedoms)]
    found = held_out_places(SimpleNamespace(held_out_places=(place,)))
    assert len(found) == named
    for each in found:
        assert (each.code, each.severity, each.about) == ("held-out-places", "info", ("a",))
        assert "0.39 mm; 0.30 mm is expected" in each.what
