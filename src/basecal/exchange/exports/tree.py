"""Trees of frames, each frame in its parent, for programs with scene trees."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from basecal.exchange.exports.exporter import NamedTransform
from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class Place:
    """A frame of a tree.

    Attributes:
        name: Name of the frame in other programs.
        parent_from_frame: Pose of the frame in its parent; None at the root of a tree.
        children: Frames whose parent is this frame.
    """

    name: str
    parent_from_frame: SE3 | None
    children: tuple[Place, ...]


def places(transforms: Sequence[NamedTransform]) -> tuple[Place, ...]:
    """Build trees from transforms, and return their roots: frames that are not a child of any other."""
    children = {one.own_frames[1] for one in transforms}
    roots = dict.fromkeys(parent for parent, _ in (one.own_frames for one in transforms) if parent not in children)
    # Names of frames in other programs, or in the cell if two of these names are equal.
    elsewhere = {
        frame: name for one in transforms for frame, name in zip(one.own_frames, (one.parent, one.child), strict=True)
    }
    counts = Counter(elsewhere.values())
    names = {frame: name if counts[name] == 1 else frame for frame, name in elsewhere.items()}
    return tuple(_place(root, None, transforms, names) for root in roots)


def _place(
    frame: str, parent_from_frame: SE3 | None, transforms: Sequence[NamedTransform], names: Mapping[str, str]
) -> Place:
    known_in_it = [one for one in transforms if one.own_frames[0] == frame]
    inside = tuple(_place(one.own_frames[1], one.estimate.mean, transforms, names) for one in known_in_it)
    return Place(names[frame], parent_from_frame, inside)
