"""Views that a capture refuses as blurred by motion: none that is only soft, and those that moved, by distance."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from basecal.acquisition.taking import Sharpness
from basecal.cell import Target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Camera
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.edge_width import edge_width
from benchmarks.common import on_one_core, table, write

LENS = Camera("pinhole", np.array([1100.0, 1100.0, 639.5, 359.5]), (1280, 720))
TARGETS: dict[str, Target] = {
    "charuco": charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50"),
    "chessboard": chessboard_target((9, 6), 0.03),
    "circles": circles_target((4, 11), 0.02, asymmetric=True),
}
BLURS_PX = (0.7, 1.0, 2.0, 3.0, 4.0)
MOTIONS_PX = (4.0, 5.0, 6.0, 8.0)
OLD_PX = 5.0  # the fixed limit of earlier versions


def _pose(shape: Target, rng: np.random.Generator) -> SE3:
    """A view of the target: tilted by some 23 deg, 250 to 500 px large."""
    rotation = cv2.Rodrigues(rng.normal(0, 0.4, 3))[0]
    distance_m = LENS.parameters[0] * np.ptp(shape.points, axis=0).max() / rng.uniform(250, 500)
    position = np.array([*(distance_m * rng.uniform(-0.05, 0.05, 2)), distance_m])
    return SE3(rotation, position - rotation @ shape.points.mean(0))


def count_refused(name: str, blur_px: float, views: int, seed: int) -> dict[str, Any]:
    """Count still views refused by the current and the old limit, then moving views refused, by length of motion."""
    shape, rng, sharpness = TARGETS[name], np.random.default_rng([seed, 41]), Sharpness()
    settings = RenderSettings(blur_px=blur_px)

    def are_refused(motion_px: float, number: int) -> tuple[bool, bool]:
        pose, angle = _pose(shape, rng), rng.uniform(0, 2 * np.pi)
        levels = radiance(LENS, [(shape, pose)], settings)
        if motion_px:
            levels = blur_motion(levels, motion_px * np.array([np.cos(angle), np.sin(angle)]))
        pixels = LENS.project(pose @ shape.points)
        width = edge_width(expose(levels, settings, number), pixels)
        assert width is not None
        return sharpness.is_blurred((name, name), width, pixels, shape.points), width.wide_px > OLD_PX

    still = [are_refused(0.0, k) for k in range(views)]
    moved = {str(motion): [are_refused(motion, k) for k in range(views)] for motion in MOTIONS_PX}
    return {
        "target": name,
        "blur_px": blur_px,
        "views": views,
        "still": sum(now for now, _ in still),
        "still_old": sum(old for _, old in still),
        "moved": {motion: sum(now for now, _ in each) for motion, each in moved.items()},
    }


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = []
    for each in result["rows"]:
        moved = (f"{each['moved'][str(motion)]}" for motion in MOTIONS_PX)
        rows.append((each["target"], f"{each['blur_px']:g} px", each["still"], each["still_old"], *moved))
    views = result["rows"][0]["views"]
    head = ("target", "softness (sigma)", "still", f"still, limit {OLD_PX:g} px")
    about = f"""\
The table counts how many of {views} views a capture refuses as blurred, by the softness of lens or print. All still
views should pass. They are also judged by the fixed limit of earlier versions. The other views moved in a random
direction during the exposure. A motion that is short relative to the softness changes nothing, and passes."""
    return f"{about}\n\n{table((*head, *(f'moved by {motion:g} px' for motion in MOTIONS_PX)), rows)}"


def main(words: Sequence[str] | None = None) -> int:
    """Measure, print and write; 1 where a still view was refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=12, help="of each target, softness and length of motion")
    asked = parser.parse_args(words)
    on_one_core()
    cv2.setNumThreads(1)
    rows = [count_refused(name, blur, asked.views, k) for name in TARGETS for k, blur in enumerate(BLURS_PX)]
    write("blurred_views", {"rows": rows})
    print(section({"rows": rows}))
    return int(any(row["still"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
