"""The budget as a bar."""

from __future__ import annotations

import re

from basecal.cell import BudgetEntry
from basecal.reporting.decision.budget_bar import budget_bar


def test_parts_are_as_long_as_their_shares() -> None:
    """One after the other; a small one has no number inside, and all are told when pointed at."""
    figure = budget_bar(
        [BudgetEntry(name, 1e-3, share, 1e-3) for name, share in (("a<", 0.75), ("b", 0.2), ("c", 0.05))]
    )
    assert [float(found) for found in re.findall(r' x="([0-9.]+)" width', figure.svg)] == [0.0, 480.0, 608.0]
    assert [float(found) for found in re.findall(r'width="([0-9.]+)"', figure.svg)] == [480.0, 128.0, 32.0]
    assert re.findall(r">(\d+ %)</text>", figure.svg) == ["75 %", "20 %"]
    assert "<title>a&lt;: 75 %</title>" in figure.svg
