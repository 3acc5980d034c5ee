"""The error of a number that is stated without its sigma."""

from __future__ import annotations

from typing import NamedTuple


class StatedNumber(NamedTuple):
    """What is expected of a stated number.

    Attributes:
        sigma: One sigma of its error, in the unit of its candidate.
        source: Of the sigma, or `assumed`.
    """

    sigma: float
    source: str
