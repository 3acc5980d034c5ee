"""Rooms of two arms that `benchmarks.scene` renders: sound ones, and deceptive ones."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np

from basecal.geometry import SE3, Array

VIEWS = 10
_EXAMPLE = Path(__file__).parents[1] / "examples" / "scene" / "make.py"


def _load_example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("scene_example", _EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


EXAMPLE = _load_example()
Face = tuple[Array, Array, Array]
Poses = list[SE3]
Mistake = Callable[[tuple[Poses, Poses]], tuple[Poses, Poses]]
"""From the true flange poses of both arms to the recorded ones."""


@dataclass(frozen=True, eq=False)
class Room:
    """Scene of each arm, and its views.

    Attributes:
        faces: Faces and their textures, for the images of each arm.
        middle: (2, 3) point that each arm looks at [m].
        views: Number of images of each arm.
        gripper: Share of each image's width and height that a gripper covers, which moves with the camera.
        drift: (3,) motion of the whole scene between two images [m].
    """

    faces: tuple[tuple[list[Face], list[Array]], tuple[list[Face], list[Array]]]
    middle: Array
    views: int = VIEWS
    gripper: float = 0.0
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)


def box(corner: Array, size: Array, yaw: float) -> list[Face]:
    """Top and four sides of a box that stands on the table."""
    u = size[0] * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    v = size[1] * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    w = np.array([0.0, 0.0, size[2]])
    return [(corner + w, u, v), (corner, u, w), (corner, v, w), (corner + u, v, w), (corner + v, u, w)]


def paint_faces(rng: np.random.Generator, faces: Sequence[Face], contrast: float = 1.0) -> list[Array]:
    """A texture for each face."""
    sizes = [[max(int(EXAMPLE.TEXELS_PER_M * np.linalg.norm(side)), 32) for side in (b, a)] for _, a, b in faces]
    return [EXAMPLE.texture(rng, (height, width), contrast) for height, width in sizes]


def random_boxes(rng: np.random.Generator, count: int, middle: Array) -> list[Face]:
    """Boxes about a place."""
    return [
        face
        for _ in range(count)
        for face in box(
            middle + np.array([*rng.uniform(-0.35, 0.25, 2), 0.0]),
            rng.uniform(0.08, 0.25, 3),
            float(rng.uniform(0, np.pi)),
        )
    ]


TABLE: list[Face] = [
    (np.array([-0.6, -1.5, 0.0]), np.array([2.6, 0, 0]), np.array([0, 3.0, 0])),
    (np.array([-0.6, 1.2, 0.0]), np.array([2.6, 0, 0]), np.array([0, 0, 1.6])),
]
MIDDLE = np.array([0.7, 0.0, 0.0])


def plain(rng: np.random.Generator, contrast: float = 1.0, views: int = VIEWS, boxes: int = 3) -> Room:
    """A table, a wall and boxes."""
    faces = [*TABLE, *random_boxes(rng, boxes, MIDDLE)]
    scene = faces, paint_faces(rng, faces, contrast)
    return Room((scene, scene), np.tile(MIDDLE, (2, 1)), views)


def equal_boxes(rng: np.random.Generator, contrast: float) -> Room:
    """A table of little contrast with two equal groups of boxes; each arm sees one of them."""
    group, distance = random_boxes(rng, 2, MIDDLE), np.array([0.0, rng.uniform(0.5, 0.8), 0.0])
    faces = [
        TABLE[0],
        *[(c - distance / 2, a, b) for c, a, b in group],
        *[(c + distance / 2, a, b) for c, a, b in group],
    ]
    bare, group_paint = paint_faces(rng, faces[:1], contrast), paint_faces(rng, group)
    scene = faces, [*bare, *group_paint, *group_paint]
    return Room((scene, scene), MIDDLE + np.array([[-0.5], [0.5]]) * distance)


def tiles(rng: np.random.Generator, boxes: int = 0) -> Room:
    """A floor of equal tiles, and some boxes or nothing else."""
    size = int(EXAMPLE.TEXELS_PER_M * rng.uniform(0.15, 0.4))
    tile = EXAMPLE.texture(rng, (size, size), 1.0)
    height, width = (int(EXAMPLE.TEXELS_PER_M * length) for length in (3.0, 2.6))
    level = np.tile(tile, (height // size + 1, width // size + 1))[:height, :width]
    own = random_boxes(rng, boxes, MIDDLE)
    scene = [*TABLE[:1], *own], [level, *paint_faces(rng, own)]
    return Room((scene, scene), np.tile(MIDDLE, (2, 1)))


def look_alike_rooms(rng: np.random.Generator) -> Room:
    """Separate rooms of both arms, with the same boxes at other places on another table."""
    count = 3
    groups = [random_boxes(np.random.default_rng(int(rng.integers(2**31))), 1, MIDDLE) for _ in range(count)]
    paint = [paint_faces(rng, group) for group in groups]
    rooms = []
    for _ in range(2):
        faces, levels = [*TABLE], paint_faces(rng, TABLE)
        for group, level in zip(groups, paint, strict=True):
            shift = np.array([*rng.uniform(-0.25, 0.25, 2), 0.0])
            faces += [(c + shift, a, b) for c, a, b in group]
            levels += level
        rooms.append((faces, levels))
    return Room((rooms[0], rooms[1]), np.tile(MIDDLE, (2, 1)))


def separated_views(rng: np.random.Generator, overlap: float) -> Room:
    """Arms whose views overlap by this share, or not at all."""
    room = plain(rng)
    step = np.array([0.0, (1 - overlap) * 1.1, 0.0])
    return replace(room, middle=MIDDLE + np.array([[-0.5], [0.5]]) * step)


def moved_boxes(rng: np.random.Generator, contrast: float, together: bool) -> Room:
    """Boxes that move before the second arm looks, together or separately, on a table of some contrast."""
    boxes = [random_boxes(rng, 1, MIDDLE) for _ in range(4)]
    shifts = [np.array([*(rng.choice([-1, 1], 2) * rng.uniform(0.03, 0.2, 2)), 0.0]) for _ in boxes]
    faces = [*TABLE, *(face for each in boxes for face in each)]
    pairs = zip(boxes, [shifts[0]] * len(boxes) if together else shifts, strict=True)
    after = [*TABLE, *((c + shift, a, b) for each, shift in pairs for c, a, b in each)]
    levels = [*paint_faces(rng, TABLE, contrast), *paint_faces(rng, faces[len(TABLE) :])]
    return Room(((faces, levels), (after, levels)), np.tile(MIDDLE, (2, 1)))


def drifting_room(rng: np.random.Generator) -> Room:
    """A conveyor: the whole scene moves by 0.5 to 20 mm from image to image."""
    direction = rng.uniform(0, 2 * np.pi)
    step = 10 ** rng.uniform(-3.3, -1.7)
    return replace(plain(rng), drift=(step * np.cos(direction), step * np.sin(direction), 0.0))


def second_arm_mistake(mistake: Callable[[Poses, Poses], Poses]) -> Mistake:
    """A mistake in the poses of the second arm alone, as a function of its own poses and the other arm's."""
    return lambda poses: (poses[0], mistake(poses[1], poses[0]))


def _shuffle(own: Poses, other: Poses) -> Poses:
    return [own[k] for k in np.random.default_rng(len(own)).permutation(len(own))]


def _lose_pose(own: Poses, other: Poses) -> Poses:
    half = len(own) // 2
    return [*own[:half], *own[half + 1 :], own[half]]


ROOMS: dict[str, Callable[[np.random.Generator], Room]] = {
    "plain": plain,
    "a third of the contrast": lambda rng: plain(rng, 0.3),
    "a table alone": lambda rng: plain(rng, boxes=0),
    "each box moved, table seen": lambda rng: moved_boxes(rng, 1.0, together=False),
    "gripper in view": lambda rng: replace(plain(rng), gripper=0.3),
    "8 views": lambda rng: plain(rng, views=8),
    "two equal groups": lambda rng: equal_boxes(rng, 0.3),
    "two equal groups on a bare table": lambda rng: equal_boxes(rng, 0.02),
    "equal tiles": tiles,
    "equal tiles and a box": lambda rng: tiles(rng, 1),
    "look-alike rooms": look_alike_rooms,
    "a fifth in common": lambda rng: separated_views(rng, 0.2),
    "nothing in common": lambda rng: separated_views(rng, 0.0),
    "all boxes moved together, table bare": lambda rng: moved_boxes(rng, 0.02, together=True),
    "a conveyor": drifting_room,
    "a gripper over most of the view, table bare": lambda rng: replace(plain(rng, 0.02), gripper=0.8),
}
MISTAKES: dict[str, Mistake] = {
    "another order": second_arm_mistake(_shuffle),
    "shifted by one": second_arm_mistake(lambda own, other: [*own[1:], own[0]]),
    "a pose lost halfway": second_arm_mistake(_lose_pose),
    "inverted poses": second_arm_mistake(lambda own, other: [pose.inverse() for pose in own]),
    "the other arm's poses": second_arm_mistake(lambda own, other: other),
    "swapped cameras": lambda poses: (poses[1], poses[0]),
}


def lengthen_arm(own: Poses) -> Poses:
    """Poses of an arm that is 0.2 % longer than its controller assumes."""
    return [SE3(pose.rotation, pose.translation * (1 + LENGTH_ERROR)) for pose in own]


def turn_wrist(own: Poses) -> Poses:
    """Poses of an arm whose last axis is off by up to 2 mrad, twice each turn."""
    yaws = [np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]) for pose in own]
    turns = [np.array([0, 0, 0, 0, 0, WRIST_RAD * np.sin(2 * yaw)]) for yaw in yaws]
    return [pose @ SE3.exp(turn) for pose, turn in zip(own, turns, strict=True)]


LENGTH_ERROR, WRIST_RAD = 2e-3, 2e-3
ARM_ERRORS: dict[str, Mistake] = {
    "an arm 0.2 % too long": lambda poses: (lengthen_arm(poses[0]), poses[1]),
    "both arms 0.2 % too long": lambda poses: (lengthen_arm(poses[0]), lengthen_arm(poses[1])),
    "wrists off by 2 mrad": lambda poses: (turn_wrist(poses[0]), turn_wrist(poses[1])),
}
KINDS = [*ROOMS, *MISTAKES, *ARM_ERRORS]
RIGHT = KINDS[:6]
AMBIGUOUS = "two equal groups on a bare table", "all boxes moved together, table bare"
