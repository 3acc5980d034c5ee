"""Tests of the lines of `cell.yaml` that findings offer."""

from __future__ import annotations

import pytest

from basecal.accuracy.fixing.offers import is_fixable, offered_places
from basecal.cell import Finding
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=1), 2).cell


@pytest.mark.parametrize(
    ("about", "do", "places"),
    [
        (("eye",), "Write `deflection: {status: free}` at eye in cell.yaml.", {("robots", "eye", "deflection")}),
        (("wrist",), "'board': 7x7 squares fit: write `squares: [7, 7]`.", {("targets", "board", "squares")}),
        (("board",), "Other markers: write kind: charuco, aprilgrid or apriltag, whichever it is.", set()),
        (("board",), "Measure its print.", set()),
        (("board",), "Write on: world of board in cell.yaml.", set()),
        (("wrist",), "Write `squares: [7, 7]`.", set()),
    ],
)
def test_offered_lines_have_owner_and_value(about: tuple[str, ...], do: str, places: set[tuple[str, str, str]]) -> None:
    """An offered line in backquotes belongs to the quoted device, else to the finding's.

    A choice of values is no offer.
    """
    finding = Finding("x", "warning", about, "It is wrong.", (do,))
    assert set(offered_places(CELL, finding)) == places
    assert is_fixable(CELL, finding) == bool(places)


def test_infos_are_not_fixed() -> None:
    """An info is not fixed though it has advice; a warning that names the command is."""
    do = ("`basecal fix CELL` takes them out of the recording.",)
    assert not is_fixable(CELL, Finding("outlier-samples", "info", ("3",), "Sample 3 was left out.", do))
    assert is_fixable(CELL, Finding("outlier-samples", "warning", ("3",), "Sample 3 was left out.", do))
