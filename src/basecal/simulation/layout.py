"""Carriers of cameras and targets, and pairs of a camera and a visible target."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from basecal.cell.cell import WORLD
from basecal.simulation.scenario import LayoutName

View = tuple[str, str]


@dataclass(frozen=True)
class Layout:
    """The layout of a cell.

    Attributes:
        robots: Names of the robots, the reference first.
        cameras: Carrier of each camera: a robot, or `world`.
        targets: Carrier of each target: a robot, or `world`.
        groups: Pairs (camera, target) that are observed in the same sample; groups are recorded one after another.
        records_all: Whether the parked robots, which carry nothing of a group, are also recorded.
    """

    robots: tuple[str, ...]
    cameras: Mapping[str, str]
    targets: Mapping[str, str]
    groups: tuple[tuple[View, ...], ...]
    records_all: bool = True

    def carrier(self, name: str) -> str:
        """Carrier of a camera or target: a robot, or `world`."""
        return self.cameras.get(name) or self.targets[name]

    def movers(self, group: tuple[View, ...]) -> tuple[str, ...]:
        """Robots that carry the cameras and targets of a group: those of cameras first, in the order of the views."""
        carriers = [self.cameras[camera] for camera, _ in group] + [self.targets[target] for _, target in group]
        return tuple(dict.fromkeys(carrier for carrier in carriers if carrier != WORLD))


def make_layout(name: LayoutName, robots: int = 3) -> Layout:
    """Layout of a given name; `robots` is the number of robots of a `chain`, a `ring` or a `grid`."""
    if name in ("chain", "ring", "grid"):
        return _many_robots(name, robots)
    wrist, both = (("wrist", "board"),), (("left_camera", "board"), ("right_camera", "board"))
    return {
        "dual": Layout(("eye", "hand"), {"wrist": "eye"}, {"board": "hand"}, (wrist,)),
        "eye_in_hand": Layout(("arm",), {"wrist": "arm"}, {"board": WORLD}, (wrist,)),
        "eye_to_hand": Layout(("arm",), {"overhead": WORLD}, {"board": "arm"}, ((("overhead", "board"),),)),
        "two_cameras": Layout(
            ("left", "right"), {"left_camera": "left", "right_camera": "right"}, {"board": WORLD}, (both,)
        ),
        "two_world_cameras": Layout(("arm",), {"left_camera": WORLD, "right_camera": WORLD}, {"board": "arm"}, (both,)),
    }[name]


def _many_robots(name: LayoutName, robots: int) -> Layout:
    """Layout in which robots carry a camera if they observe another robot, and a board if they are observed."""
    names = tuple(f"r{k + 1}" for k in range(robots))
    if name == "grid":
        row = math.isqrt(robots)  # length of the rows, as square as possible; the last row may be shorter
        seen = [(k, k + 1) for k in range(robots - 1) if (k + 1) % row] + [(k, k + row) for k in range(robots - row)]
    else:
        steps = (1, 2) if name == "ring" and robots > 2 else (1,)  # of two robots, the second next is the robot itself
        seen = [(k, (k + step) % robots) for k in range(robots) for step in steps]
    cameras = {f"camera{a + 1}": names[a] for a in sorted({a for a, _ in seen})}
    targets = {f"board{b + 1}": names[b] for b in sorted({b for _, b in seen})}
    groups = tuple(((f"camera{a + 1}", f"board{b + 1}"),) for a, b in seen)
    return Layout(names, cameras, targets, groups, records_all=name == "chain")
