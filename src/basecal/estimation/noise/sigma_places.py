"""Where each open sigma of a mixed model stands among their logarithms, by what it is of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.geometry import BoolArray


@dataclass(frozen=True, eq=False)
class SigmaPlaces:
    """Places among the logarithms of sigmas.

    Attributes:
        views: By camera and field of `Noise`.
        stops: By robot, the two of its single stops: of translation and rotation.
        jitter: By camera, that of its stamps.
        shared: Of each kind of errors that stops share, by robot, the two of these.
        count: How many there are.
    """

    views: Mapping[tuple[str, str], int]
    stops: Mapping[str, slice]
    jitter: Mapping[str, int]
    shared: tuple[Mapping[str, slice], ...]
    count: int

    @staticmethod
    def sequential(
        views: Sequence[tuple[str, str]], robots: Sequence[str], cameras: Sequence[str], kinds: int
    ) -> SigmaPlaces:
        """One after the other, of these views, robots and cameras with jitter, and so many kinds of shared errors."""
        of_views = {key: number for number, key in enumerate(views)}
        of_stops, at = _pairs(robots, len(of_views))
        of_jitter = {camera: at + number for number, camera in enumerate(cameras)}
        shared, count = list[Mapping[str, slice]](), at + len(of_jitter)
        for _ in range(kinds):
            of_kind, count = _pairs(robots, count)
            shared.append(of_kind)
        return SigmaPlaces(of_views, of_stops, of_jitter, tuple(shared), count)

    @property
    def is_of_views(self) -> BoolArray:
        """Which of them are of views, (k,)."""
        return np.isin(np.arange(self.count), list(self.views.values()))


def _pairs(names: Sequence[str], first: int) -> tuple[dict[str, slice], int]:
    """Two places of each name from the first on, and the place after them."""
    places = {name: slice(first + 2 * k, first + 2 * k + 2) for k, name in enumerate(names)}
    return places, first + 2 * len(places)
