"""Bases placed by relations of pairs, along the fewest that lead to them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from basecal.geometry import SE3

Relations = Mapping[tuple[str | None, str | None], SE3]
"""`eye_base_from_hand_base` of pairs, by the names of both bases; the reference has none."""


def place_bases(bases: Mapping[str, SE3], relations: Relations) -> dict[str, SE3]:
    """Where bases stand in the world: those that are given, and all that relations lead to from them."""
    near: dict[str | None, list[tuple[str | None, SE3]]] = defaultdict(list)
    for (eye, hand), eye_from_hand in relations.items():
        near[eye].append((hand, eye_from_hand))
        near[hand].append((eye, eye_from_hand.inverse()))
    placed = dict[str | None, SE3]([(None, SE3.identity()), *bases.items()])
    waiting = [*placed]
    for name in waiting:  # grows
        for other, from_other in near[name]:
            if other not in placed:
                placed[other] = placed[name] @ from_other
                waiting.append(other)
    return {name: pose for name, pose in placed.items() if name is not None}
