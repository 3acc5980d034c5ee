"""Trees of frames, each frame in its parent, for programs with scene trees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from basecal.exchange.exports.choice import distinct_names
from basecal.exchange.exports.exporter import NamedTransform
from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class FrameNode:
    """A frame of a tree.

    Attributes:
        name: Name of the frame in other programs.
        parent_from_frame: Pose of the frame in its parent; None at the root of a tree.
        children: Frames whose parent is this frame.
    """

    name: str
    parent_from_frame: SE3 | None
    children: tuple[FrameNode, ...]


def frame_trees(transforms: Sequence[NamedTransform], valid_name: Callable[[str], str] = str) -> tuple[FrameNode, ...]:
    """Build trees from transforms, and return their roots: frames that are not a child of any other.

    Args:
        transforms: The transforms.
        valid_name: Function from a name to a name that the program allows; empty if it reserves the name.
    """
    pairs = [transform.own_frames for transform in transforms]
    children = {child for _, child in pairs}
    roots = dict.fromkeys(parent for parent, _ in pairs if parent not in children)
    names = distinct_names(transforms, valid_name)
    return tuple(_frame_node(root, None, transforms, names) for root in roots)


def _frame_node(
    frame: str, parent_from_frame: SE3 | None, transforms: Sequence[NamedTransform], names: Mapping[str, str]
) -> FrameNode:
    children = tuple(
        _frame_node(child, transform.estimate.mean, transforms, names)
        for transform in transforms
        for parent, child in [transform.own_frames]
        if parent == frame
    )
    return FrameNode(names[frame], parent_from_frame, children)
