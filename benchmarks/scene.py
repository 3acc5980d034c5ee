"""Calibration from a scene: rendered rooms of two arms, sound ones, and deceptive ones that must be refused.

There are few and small images, and few points, so that hundreds of cells can be tried. In a sound room the error of the
base and its Mahalanobis distance are measured. Deceptive rooms have two equal boxes, a floor of equal tiles, little or
nothing that both arms see, moving things, a gripper in view, or poses that are shuffled, inverted or of the other arm.
A refusal is right there. An answer whose base is beyond the 99.996 % ellipsoid (M2 of 30) is false. In two rooms all
texture is copied or moved together, which no camera can detect. A base from a scene alone therefore stays doubtful.
Cells are drawn by number, kinds in turn.

Mistaken poses and arms with errors use the images of the plain room, whose features are detected once. Arms with errors
are answered, and the base's Mahalanobis distance is measured; they count neither as sound nor as deceptive.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import cv2
import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.scene import find_scene, one_camera
from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.one_camera import OneCamera, solve_camera
from basecal.cell.files import read_cell, read_recording
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, Camera
from benchmarks.common import Kept, cpu_seconds, label, on_one_core, read, table, write
from benchmarks.scene_rooms import (
    AMBIGUOUS,
    ARM_ERRORS,
    EXAMPLE,
    KINDS,
    MIDDLE,
    MISTAKES,
    RIGHT,
    ROOMS,
    VIEWS,
    Poses,
    Room,
)

BASE = "left_base_from_right_base"
NAMES = "left", "right"
FALSE_M2 = 30.0


class Design(NamedTuple):
    """Images of each arm, their size [px] and focal length [px], and the largest number of points of a camera."""

    views: int
    size: tuple[int, int]
    focal_px: float
    most_points: int

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point [px]."""
        return (self.size[0] - 1) / 2, (self.size[1] - 1) / 2


SMALL = Design(VIEWS, (320, 240), 256.0, 500)  # a third of the usual points, for speed
LARGE = Design(15, (640, 480), 512.0, one_camera._MOST_POINTS)
TIMED = {
    "1280x720": Design(25, (1280, 720), 1024.0, one_camera._MOST_POINTS),
    "1920x1200": Design(30, (1920, 1200), 1536.0, one_camera._MOST_POINTS),
}
DESIGNS = {"small": SMALL, "large": LARGE, **TIMED}
_PARTS = {"small": "cells"}  # names in the results that differ from those of designs
OTHER_POSES = MISTAKES | ARM_ERRORS
ORDER = ["plain", *OTHER_POSES, *(kind for kind in ROOMS if kind != "plain")]  # kinds with the same images first
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


class Rendering:
    """Images of a room in a temporary folder, the true base, and the true flange poses of both arms."""

    def __init__(self, kind: str, seed: int, design: Design) -> None:
        self._home = tempfile.TemporaryDirectory()
        self.folder = Path(self._home.name)
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        room = ROOMS[kind](rng)
        if room.views == VIEWS:
            room = replace(room, views=design.views)
        self.base = SE3.from_rpy(
            (*rng.uniform(-0.03, 0.03, 2), rng.uniform(2.2, 4.0)), (1.4, *rng.uniform(-0.15, 0.15, 2))
        )
        looks = [_looks(rng, room, arm) for arm in range(2)]
        _render(self.folder, room, looks, design, rng)
        self.poses = tuple(
            _flange_poses(rng, at, own) for at, own in zip((SE3.identity(), self.base), looks, strict=True)
        )


def _looks(rng: np.random.Generator, room: Room, arm: int) -> Poses:
    """Poses of the camera of an arm in the world."""
    poses = EXAMPLE.looks(rng, room.views, (-1.0, 1.0)[arm])
    return [SE3(pose.rotation, pose.translation + room.middle[arm] - MIDDLE) for pose in poses]


def _flange_poses(rng: np.random.Generator, base: SE3, looks: Poses) -> Poses:
    """Poses of the flange of an arm with errors, in its base."""
    mount = SE3.from_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.08, 0.08, 3) + np.array([0, 0, 0.07]))
    noise = np.repeat([EXAMPLE.ARM_M, EXAMPLE.ARM_RAD], 3)
    return [base.inverse() @ look @ mount.inverse() @ SE3.exp(rng.standard_normal(6) * noise) for look in looks]


def _render(folder: Path, room: Room, looks: Sequence[Poses], design: Design, rng: np.random.Generator) -> None:
    """Write the images of both arms with consecutive numbers."""
    numbers = [design.focal_px, design.focal_px, *design.centre, *EXAMPLE.DISTORTION]
    lens = Camera("pinhole", np.array(numbers), design.size)
    width, height = (int(room.gripper * side) for side in design.size)
    gripper = EXAMPLE.texture(rng, (height, width), 1.0) if room.gripper else None
    (folder / "recording/images").mkdir(parents=True)
    number = 0
    for arm, own in enumerate(looks):
        for look in own:
            camera_pose = SE3(look.rotation, look.translation - number * np.array(room.drift))
            level = EXAMPLE.render_image(camera_pose, lens, *room.faces[arm], rng)
            if gripper is not None:
                level[-height:, :width] = gripper
            cv2.imwrite(str(folder / f"recording/images/{number}.png"), level)
            number += 1


def _write_cell(folder: Path, poses: tuple[Poses, Poses], design: Design) -> None:
    """Write cell and samples with these poses beside the images."""
    pairs = [(name, pose) for name, own in zip(NAMES, poses, strict=True) for pose in own]
    lines = [
        {
            "sample": number,
            "robots": {name: {"base_from_flange": EXAMPLE.pose(pose)}},
            "images": {f"{name}_eye": f"images/{number}.png"},
        }
        for number, (name, pose) in enumerate(pairs)
    ]
    (folder / "recording/samples.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    names = "fx", "fy", "cx", "cy"
    lens = dict(zip(names, (design.focal_px, design.focal_px, *design.centre), strict=True))
    stated = {"status": "fixed", **lens, "distortion": EXAMPLE.DISTORTION}
    cameras = {f"{name}_eye": {"on": name, "size_px": design.size, "intrinsics": stated} for name in NAMES}
    cell = {"schema": "basecal/cell/1", "reference": "left", "target": "scene", "robots": {"left": {}, "right": {}}}
    (folder / "cell.yaml").write_text(json.dumps(cell | {"cameras": cameras}))


@lru_cache(maxsize=1)
def render_room(kind: str, seed: int, design: Design) -> Rendering:
    """Render a room; the last one is cached."""
    return Rendering(kind, seed, design)


_SOLVED_CAMERAS: dict[str, OneCamera] = {}


def solve_camera_once(images: Images, camera: int, stop_noise: Array | None) -> OneCamera:
    """The result of `solve_camera`, cached for other cells with the same images and poses."""
    rows = np.flatnonzero(images.views.camera == camera)
    poses = images.views.base_from_flange[rows]
    content = [poses.translation.tobytes(), *(images.features[row].pixels.tobytes() for row in rows)]
    key = hashlib.sha256(b"".join(content)).hexdigest()
    _SOLVED_CAMERAS[key] = _SOLVED_CAMERAS.pop(key, None) or solve_camera(images, camera, stop_noise)
    while len(_SOLVED_CAMERAS) > 2:
        del _SOLVED_CAMERAS[next(iter(_SOLVED_CAMERAS))]
    return _SOLVED_CAMERAS[key]


def trial(kind: str, seed: int, design: Design = SMALL) -> dict[str, Any]:
    """Calibrate one cell."""
    rendering = render_room("plain" if kind in OTHER_POSES else kind, seed, design)
    _write_cell(
        rendering.folder, OTHER_POSES[kind](rendering.poses) if kind in OTHER_POSES else rendering.poses, design
    )
    cell = read_cell(rendering.folder)
    answers: list[Any] = []
    recording = read_recording(rendering.folder, cell)
    with (
        patch.object(find_scene, "solve_camera", solve_camera_once),
        patch.object(one_camera, "_MOST_POINTS", design.most_points),
    ):
        cpu_s = cpu_seconds(lambda: answers.append(calibrate(cell, recording, Settings(method="scene"))))
    answer = answers[0]
    codes = [each.code for each in answer.findings if each.severity == "error"]
    result: dict[str, Any] = {"kind": kind, "seed": seed, "verdict": answer.verdict, "errors": codes, "cpu_s": cpu_s}
    result["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    if BASE in answer.transforms:
        base = answer.transforms[BASE]
        off = (rendering.base.inverse() @ base.mean).log()
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
        return [label(kind), len(cells), 0, 0, "-", "-", "-", "-", "-", ", ".join(codes)]
    mm, deg, m2 = (np.array([each[key] for each in answered]) for key in ("mm", "deg", "m2"))
    return [
        label(kind), len(cells), len(answered), false, f"{np.median(mm):.2f}", f"{np.median(deg):.3f}",
        f"{mm.max():.2f}", f"{m2.mean():.1f}", f"{m2.max():.1f}", ", ".join(codes) or "-",
    ]  # fmt: skip


def format_table(cells: Sequence[dict[str, Any]]) -> str:
    """The table of all kinds of room that were tried."""
    return table(HEAD, [row(kind, own) for kind in KINDS if (own := [each for each in cells if each["kind"] == kind])])


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    cells, large = result["cells"], result.get("large", [])
    deceptions = [kind for kind in KINDS if kind not in (*RIGHT, *AMBIGUOUS, *ARM_ERRORS)]
    deceiving = [each for each in cells if each["kind"] in deceptions]
    false = sum(each.get("m2", 0.0) > FALSE_M2 for each in deceiving)
    about = f"""\
Rendered rooms of two arms, with {SMALL.views} images of {SMALL.size[0]}x{SMALL.size[1]} for each arm. Poses have errors
of 0.2 mm and 0.3 mrad. Of {len(deceiving)} deceptive cells {false} were answered falsely, with an M2 of the base above
{FALSE_M2:g}; its mean is 6 if the covariance is true. Two kinds of rooms do not count:

- {AMBIGUOUS[0]};
- {AMBIGUOUS[1]}.

In these everything with texture is copied or moved as one, and no camera can detect this.

{_sound_text(cells)} For speed, at most {SMALL.most_points} points of each camera are used.

{format_table(cells)}"""
    return "\n\n".join(filter(None, (about, _large_text(large), _time_text(result))))


def _sound_text(cells: Sequence[dict[str, Any]]) -> str:
    """Text on how many sound cells were answered, and how well."""
    sound = [each for each in cells if each["kind"] in RIGHT]
    answered = [each for each in sound if "mm" in each]
    close = sum(each["mm"] <= 1.0 for each in answered), sum(each["deg"] <= 0.06 for each in answered)
    return (
        f"Of {len(sound)} sound cells {len(answered)} were answered, {close[0]} to 1 mm and {close[1]} to 0.06 deg.\n"
        f"A cell takes {np.median([each['cpu_s'] for each in cells]):.0f} s of CPU time (median)."
    )


def _large_text(cells: Sequence[dict[str, Any]]) -> str:
    """Text on rooms with images as large as those of users."""
    if not cells:
        return ""
    size = f"{LARGE.views} images of {LARGE.size[0]}x{LARGE.size[1]}"
    about = f"The same with {size} of each arm, and all points (`--images large`)."
    return f"{about}\n{_sound_text(cells)}\n\n{format_table(cells)}"


def _time_text(result: dict[str, Any]) -> str:
    """Text on time and memory for images of common sizes."""
    rows = [
        (name, f"2 x {design.views}", len(own), f"{np.median([each['cpu_s'] for each in own]):.0f}",
         f"{max(each['peak_gb'] for each in own):.2f}", f"{max(each['mm'] for each in own):.2f}")
        for name, design in TIMED.items() if (own := result.get(name))
    ]  # fmt: skip
    head = "image [px]", "images", "cells", "CPU time [s]", "memory [GB]", "worst [mm]"
    about = "On one core (`--images 1280x720`). The memory is the peak, with the renderer of the images."
    return f"{about}\n\n{table(head, rows)}" if rows else ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is not kept yet, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=500, help="that deceive; as many of each right kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--keep", type=Path, help="file in which cells are kept, and from which a run goes on")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which no cell is begun")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=ORDER)
    parser.add_argument(
        "--images", choices=DESIGNS, default="small", help="their size and number; all but `small` are those of users"
    )
    asked = parser.parse_args(arguments)
    on_one_core()
    kept, end = Kept(asked.keep), time.monotonic() + 60 * asked.minutes
    seed_count = -(-asked.cells // (len(KINDS) - len(RIGHT) - len(AMBIGUOUS) - len(ARM_ERRORS)))
    design, part = DESIGNS[asked.images], _PARTS.get(asked.images, asked.images)
    cells = [
        kept.of(key, lambda kind=kind, seed=seed: trial(kind, seed, design))
        for seed in range(asked.first, asked.first + seed_count)
        for kind in asked.kinds
        if (key := f"{kind}:{seed}") in kept or time.monotonic() < end
    ]
    print(f"{_sound_text(cells)}\n\n{format_table(cells)}")
    parts = {_PARTS.get(name, name) for name in DESIGNS}
    stored = {key: part_cells for key, part_cells in read("scene").items() if key in parts}
    if len(cells) < len(stored.get(part, ())):
        print("not written: results/scene.json has more cells")
    else:
        write("scene", stored | {part: cells})
    return 0


if __name__ == "__main__":
    sys.exit(main())
