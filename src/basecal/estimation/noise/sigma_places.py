"""Indices of the unstated sigmas of a mixed model in the vector of their logarithms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.geometry import BoolArray


@dataclass(frozen=True, eq=False)
class SigmaPlaces:
    """Indices in the vector of the logarithms of sigmas.

    Attributes:
        views: Index of each sigma of views, by camera and field of `Noise`.
        stops: Indices of translation and rotation of single stops, by robot.
        jitter: Index of the timing jitter, by camera.
        shared: Indices of translation and rotation of shared errors, by robot, for each kind of shared errors.
        count: Number of sigmas.
    """

    views: Mapping[tuple[str, str], int]
    stops: Mapping[str, slice]
    jitter: Mapping[str, int]
    shared: tuple[Mapping[str, slice], ...]
    count: int

    @staticmethod
    def sequential(
        views: Sequence[tuple[str, str]], robots: Sequence[str], cameras: Sequence[str], kind_count: int
    ) -> SigmaPlaces:
        """Number sigmas consecutively: of views, robots, cameras with jitter, and kinds of shared errors of robots."""
        views_index = {key: number for number, key in enumerate(views)}
        of_stops, count = _number_pairs(robots, len(views_index))
        of_jitter = {camera: count + number for number, camera in enumerate(cameras)}
        shared, count = list[Mapping[str, slice]](), count + len(of_jitter)
        for _ in range(kind_count):
            of_kind, count = _number_pairs(robots, count)
            shared.append(of_kind)
        return SigmaPlaces(views_index, of_stops, of_jitter, tuple(shared), count)

    @property
    def is_of_views(self) -> BoolArray:
        """Mask of the sigmas of views, (k,)."""
        return np.isin(np.arange(self.count), list(self.views.values()))


def _number_pairs(names: Sequence[str], first: int) -> tuple[dict[str, slice], int]:
    """Two consecutive indices for each name, starting at `first`, and the next free index."""
    places = {name: slice(first + 2 * k, first + 2 * k + 2) for k, name in enumerate(names)}
    return places, first + 2 * len(places)
