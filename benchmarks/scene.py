"""Calibration from a scene: rendered rooms of two arms, right ones, and ones that are to be refused.

Of a right room the base's error and its Mahalanobis distance are measured. Rooms that deceive have two equal boxes, a
floor of equal tiles, little or nothing that both arms see, things that moved between the arms, a gripper in view, or
poses in another order, inverted or of the other arm. A refusal is free there; an answer whose base is beyond the
99.996 % ellipsoid (M2 of 30) is false. In two rooms all that has texture is copied or moved as one:
no camera can tell, which is why a base from a scene alone stays doubtful. Cells are drawn by number, kinds in turn.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.cell.files import read_cell, read_recording
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, Camera
from benchmarks.common import Kept, cpu_seconds, on_one_core, table, write

BASE = "left_base_from_right_base"
SIZE, FOCAL, VIEWS = (480, 360), 384.0, 14
FALSE_M2 = 30.0
HEAD = (
    "room",
    "cells",
    "answered",
    "false",
    "median [mm]",
    "[deg]",
    "worst [mm]",
    "mean M2",
    "largest M2",
    "refused as",
)
_EXAMPLE = Path(__file__).parents[1] / "examples" / "scene" / "make.py"


def _load_example() -> ModuleType:
    found = importlib.util.spec_from_file_location("scene_example", _EXAMPLE)
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


EXAMPLE = _load_example()
Face = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Room:
    """What each arm sees, where from, and what becomes of its recorded poses.

    Attributes:
        faces: Of each arm's pictures: faces, and what is painted on them.
        middle: (2, 3) what each arm looks at [m].
        views: Pictures of each arm.
        gripper: Whether each camera sees something that rides with it.
        recorded: From the poses of an arm, and those of the other, to those that its samples have.
    """

    faces: tuple[tuple[list[Face], list[Array]], tuple[list[Face], list[Array]]]
    middle: Array
    views: int = VIEWS
    gripper: bool = False
    recorded: Callable[[list[SE3], list[SE3]], list[SE3]] = lambda own, other: own


def box(corner: Array, size: Array, yaw: float) -> list[Face]:
    """Top and four sides of a box that stands on the table."""
    u = size[0] * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    v = size[1] * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    w = np.array([0.0, 0.0, size[2]])
    return [(corner + w, u, v), (corner, u, w), (corner, v, w), (corner + u, v, w), (corner + v, u, w)]


def painted(rng: np.random.Generator, faces: Sequence[Face], contrast: float = 1.0) -> list[Array]:
    """A texture for each face."""
    sizes = [[max(int(EXAMPLE.TEXELS_PER_M * np.linalg.norm(side)), 32) for side in (b, a)] for _, a, b in faces]
    return [EXAMPLE.texture(rng, (height, width), contrast) for height, width in sizes]


def some_boxes(rng: np.random.Generator, count: int, middle: Array) -> list[Face]:
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
    faces = [*TABLE, *some_boxes(rng, boxes, MIDDLE)]
    seen = faces, painted(rng, faces, contrast)
    return Room((seen, seen), np.tile(MIDDLE, (2, 1)), views)


def equal_boxes(rng: np.random.Generator, contrast: float) -> Room:
    """A table of little contrast with two equal groups of boxes; each arm sees one of them."""
    group, apart = some_boxes(rng, 2, MIDDLE), np.array([0.0, rng.uniform(0.5, 0.8), 0.0])
    faces = [TABLE[0], *[(c - apart / 2, a, b) for c, a, b in group], *[(c + apart / 2, a, b) for c, a, b in group]]
    bare, of_group = painted(rng, faces[:1], contrast), painted(rng, group)
    seen = faces, [*bare, *of_group, *of_group]
    return Room((seen, seen), MIDDLE + np.array([[-0.5], [0.5]]) * apart)


def tiles(rng: np.random.Generator) -> Room:
    """A floor of equal tiles, and nothing else."""
    size = int(EXAMPLE.TEXELS_PER_M * rng.uniform(0.15, 0.4))
    tile = EXAMPLE.texture(rng, (size, size), 1.0)
    height, width = (int(EXAMPLE.TEXELS_PER_M * length) for length in (3.0, 2.6))
    level = np.tile(tile, (height // size + 1, width // size + 1))[:height, :width]
    seen = TABLE[:1], [level]
    return Room((seen, seen), np.tile(MIDDLE, (2, 1)))


def look_alike_rooms(rng: np.random.Generator) -> Room:
    """Each arm has a room of its own, with the same boxes in other places on another table."""
    count = 3
    groups = [some_boxes(np.random.default_rng(int(rng.integers(2**31))), 1, MIDDLE) for _ in range(count)]
    paint = [painted(rng, group) for group in groups]
    rooms = []
    for _ in range(2):
        faces, levels = [*TABLE], painted(rng, TABLE)
        for group, level in zip(groups, paint, strict=True):
            shift = np.array([*rng.uniform(-0.25, 0.25, 2), 0.0])
            faces += [(c + shift, a, b) for c, a, b in group]
            levels += level
        rooms.append((faces, levels))
    return Room((rooms[0], rooms[1]), np.tile(MIDDLE, (2, 1)))


def apart(rng: np.random.Generator, overlap: float) -> Room:
    """Arms that look at places so far apart that they share this much, or nothing."""
    room = plain(rng)
    step = np.array([0.0, (1 - overlap) * 1.1, 0.0])
    return replace(room, middle=MIDDLE + np.array([[-0.5], [0.5]]) * step)


def moved_boxes(rng: np.random.Generator, contrast: float, together: bool) -> Room:
    """Boxes that move before the second arm looks, together or each for itself, on a table of some contrast."""
    boxes = [some_boxes(rng, 1, MIDDLE) for _ in range(4)]
    shifts = [np.array([*(rng.choice([-1, 1], 2) * rng.uniform(0.03, 0.2, 2)), 0.0]) for _ in boxes]
    faces = [*TABLE, *(face for each in boxes for face in each)]
    pairs = zip(boxes, [shifts[0]] * len(boxes) if together else shifts, strict=True)
    after = [*TABLE, *((c + shift, a, b) for each, shift in pairs for c, a, b in each)]
    levels = [*painted(rng, TABLE, contrast), *painted(rng, faces[len(TABLE) :])]
    return Room(((faces, levels), (after, levels)), np.tile(MIDDLE, (2, 1)))


def _shuffled(own: list[SE3], other: list[SE3]) -> list[SE3]:
    return [own[k] for k in np.random.default_rng(len(own)).permutation(len(own))]


ROOMS: dict[str, Callable[[np.random.Generator], Room]] = {
    "plain": plain,
    "a third of the contrast": lambda rng: plain(rng, 0.3),
    "a table alone": lambda rng: plain(rng, boxes=0),
    "each box moved, table seen": lambda rng: moved_boxes(rng, 1.0, together=False),
    "gripper in view": lambda rng: replace(plain(rng), gripper=True),
    "8 views": lambda rng: plain(rng, views=8),
    "two equal groups": lambda rng: equal_boxes(rng, 0.3),
    "two equal groups on a bare table": lambda rng: equal_boxes(rng, 0.02),
    "equal tiles": tiles,
    "look-alike rooms": look_alike_rooms,
    "a fifth in common": lambda rng: apart(rng, 0.2),
    "nothing in common": lambda rng: apart(rng, 0.0),
    "all boxes moved together, table bare": lambda rng: moved_boxes(rng, 0.02, together=True),
    "another order": lambda rng: replace(plain(rng), recorded=_shuffled),
    "shifted by one": lambda rng: replace(plain(rng), recorded=lambda own, other: [*own[1:], own[0]]),
    "inverted poses": lambda rng: replace(plain(rng), recorded=lambda own, other: [pose.inverse() for pose in own]),
    "the other arm's poses": lambda rng: replace(plain(rng), recorded=lambda own, other: other),
}
RIGHT = 6  # of these rooms are right
AMBIGUOUS = "two equal groups on a bare table", "all boxes moved together, table bare"


def draw(folder: Path, kind: str, seed: int) -> SE3:
    """Write a cell with pictures; its true base."""
    rng = np.random.default_rng([seed, list(ROOMS).index(kind)])
    room = ROOMS[kind](rng)
    base = SE3.from_rpy((*rng.uniform(-0.03, 0.03, 2), rng.uniform(2.2, 4.0)), (1.4, *rng.uniform(-0.15, 0.15, 2)))
    mounts = [
        SE3.from_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.08, 0.08, 3) + np.array([0, 0, 0.07])) for _ in range(2)
    ]
    centre = (SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2
    lens = Camera("pinhole", np.array([FOCAL, FOCAL, *centre, *EXAMPLE.DISTORTION]), SIZE)
    looks = [
        [
            SE3(pose.rotation, pose.translation + room.middle[arm] - MIDDLE)
            for pose in EXAMPLE.looks(rng, room.views, side)
        ]
        for arm, side in enumerate((-1.0, 1.0))
    ]
    noise = np.repeat([EXAMPLE.ARM_M, EXAMPLE.ARM_RAD], 3)
    own = [
        [at.inverse() @ look @ mount.inverse() @ SE3.exp(rng.standard_normal(6) * noise) for look in looks[arm]]
        for arm, (at, mount) in enumerate(zip((SE3.identity(), base), mounts, strict=True))
    ]
    gripper = EXAMPLE.texture(rng, (SIZE[1] // 4, SIZE[0] // 3), 1.0)
    lines: list[str] = []
    for arm, name in enumerate(("left", "right")):
        (folder / f"recording/images/{name}_eye").mkdir(parents=True)
        # Poses are mistaken of the second arm alone.
        recorded = room.recorded(own[1], own[0]) if arm else own[0]
        for look, pose in zip(looks[arm], recorded, strict=True):
            level = EXAMPLE.picture(look, lens, *room.faces[arm], rng)
            if room.gripper:
                level[-gripper.shape[0] :, : gripper.shape[1]] = gripper
            path = f"images/{name}_eye/{len(lines):06d}.png"
            cv2.imwrite(str(folder / "recording" / path), level)
            robots = {name: {"base_from_flange": EXAMPLE.pose(pose)}}
            lines.append(json.dumps({"sample": len(lines), "robots": robots, "images": {f"{name}_eye": path}}))
    (folder / "recording/samples.jsonl").write_text("\n".join(lines) + "\n")
    stated = {"status": "fixed", "fx": FOCAL, "fy": FOCAL, "cx": centre[0], "cy": centre[1]}
    stated["distortion"] = EXAMPLE.DISTORTION
    cameras = {f"{name}_eye": {"on": name, "size_px": SIZE, "intrinsics": stated} for name in ("left", "right")}
    cell = {"schema": "basecal/cell/1", "reference": "left", "target": "scene", "robots": {"left": {}, "right": {}}}
    (folder / "cell.yaml").write_text(json.dumps(cell | {"cameras": cameras}))
    return base


def tried(kind: str, seed: int) -> dict[str, Any]:
    """What comes of a cell."""
    with tempfile.TemporaryDirectory() as name:
        true = draw(Path(name), kind, seed)
        cell = read_cell(name)
        found: list[Any] = []
        cpu_s = cpu_seconds(lambda: found.append(calibrate(cell, read_recording(name, cell), Settings(method="scene"))))
    answer = found[0]
    codes = [each.code for each in answer.findings if each.severity == "error"]
    result: dict[str, Any] = {"kind": kind, "seed": seed, "verdict": answer.verdict, "errors": codes, "cpu_s": cpu_s}
    if BASE in answer.transforms:
        base = answer.transforms[BASE]
        off = (true.inverse() @ base.mean).log()
        m2 = float(off @ np.linalg.solve(base.covariance, off))
        mm, deg = 1e3 * float(np.linalg.norm(off[:3])), float(np.degrees(np.linalg.norm(off[3:])))
        result |= {"mm": mm, "deg": deg, "m2": m2}
    return result


def row(kind: str, cells: Sequence[dict[str, Any]]) -> list[object]:
    """A line of the table with `HEAD`."""
    answered = [each for each in cells if "mm" in each]
    false = sum(each["m2"] > FALSE_M2 for each in answered)
    codes = sorted({code for each in cells for code in each["errors"]})
    if not answered:
        return [kind, len(cells), 0, 0, "-", "-", "-", "-", "-", ", ".join(codes)]
    mm, deg, m2 = (np.array([each[key] for each in answered]) for key in ("mm", "deg", "m2"))
    return [
        kind, len(cells), len(answered), false, f"{np.median(mm):.2f}", f"{np.median(deg):.3f}", f"{mm.max():.2f}",
        f"{m2.mean():.1f}", f"{m2.max():.1f}", ", ".join(codes) or "-",
    ]  # fmt: skip


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    cells = result["cells"]
    rows = [row(kind, own) for kind in ROOMS if (own := [each for each in cells if each["kind"] == kind])]
    deceptions = [kind for kind in list(ROOMS)[RIGHT:] if kind not in AMBIGUOUS]
    deceiving = [each for each in cells if each["kind"] in deceptions]
    false = sum(each.get("m2", 0.0) > FALSE_M2 for each in deceiving)
    about = f"""\
Rendered rooms of two arms, {VIEWS} pictures of {SIZE[0]}x{SIZE[1]} each, poses off by 0.2 mm and 0.3 mrad. Of
{len(deceiving)} cells that deceive, {false} were answered falsely (M2 of the base above {FALSE_M2:g}, 6 is right).
Not counted are "{AMBIGUOUS[0]}" and "{AMBIGUOUS[1]}": all that has
texture is copied or moved as one, which no camera can tell.
A cell takes {np.median([each["cpu_s"] for each in cells]):.0f} s of the processor (median)."""
    return f"{about}\n\n{table(HEAD, rows)}"


def main(words: Sequence[str] | None = None) -> int:
    """Measure what is not kept yet, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=500, help="that deceive; as many of each right kind")
    parser.add_argument("--keep", type=Path, help="file in which cells are kept, and from which a run goes on")
    parser.add_argument("--kinds", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    asked = parser.parse_args(words)
    on_one_core()
    kept = Kept(asked.keep)
    each = -(-asked.cells // (len(ROOMS) - RIGHT))
    cells = [
        kept.of(f"{kind}:{seed}", lambda kind=kind, seed=seed: tried(kind, seed))
        for seed in range(each)
        for kind in asked.kinds
    ]
    print(section({"cells": cells}))
    write("scene", {"cells": cells})
    return 0


if __name__ == "__main__":
    sys.exit(main())
