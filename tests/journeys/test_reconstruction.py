"""Journey: two arms with images in one reconstruction, by the commands of docs/importing.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main
from basecal.geometry import SE3
from colmap_files import Image, write_reconstruction

UNIT_M = 0.173
ARM = np.repeat([1e-4, 2e-4], 3)
POSE = np.repeat([3e-4, 5e-4], 3)  # of a reconstruction [m, rad]
DOWN, AHEAD = np.array([np.pi, 0.0, 0.0]), np.array([0.5, 0.0, 0.5])
BASE = SE3.from_rpy((0.01, -0.02, 2.9), (1.3, 0.1, 0.0))


def recorded(rng: np.random.Generator, base: SE3, mount: SE3, name: str, number: int) -> tuple[str, list[Image]]:
    """Table of an arm's poses as printed by a UR, and the poses of its camera in the reconstruction."""
    rows, images = ["x,y,z,rx,ry,rz,image"], []
    room = SE3.from_rpy((0.3, 0.1, -0.4), (0.6, 0.2, -0.1))
    for k in range(16):
        flange = SE3.from_rpy(rng.uniform(-0.7, 0.7, 3) + DOWN, rng.uniform(-0.25, 0.25, 3) + AHEAD)
        seen = (base @ flange @ SE3.exp(rng.normal(size=6) * ARM) @ mount).inverse() @ room
        seen = SE3.exp(rng.normal(size=6) * POSE) @ seen
        images.append(Image(f"{name}_{k}.png", number, SE3(seen.rotation, seen.translation / UNIT_M)))
        vector = SE3(flange.rotation, np.zeros(3)).log()[3:]
        rows.append(",".join(repr(float(each)) for each in (*flange.translation, *vector)) + f",{name}_{k}.png")
    return "\n".join(rows) + "\n", images


def test_two_arms_of_one_reconstruction(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The base is within the 99.9 % ellipsoid, and the length unit is correct to 1 %."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(7)
    mounts = [SE3.from_rpy((0.1, 0.2, 0.3), (0.02, 0.05, 0.08)), SE3.from_rpy((-0.2, 0.1, 1.0), (0.0, -0.06, 0.07))]
    made = [
        recorded(rng, base, mount, name, number)
        for base, mount, name, number in zip((SE3.identity(), BASE), mounts, ("left", "right"), (1, 2), strict=True)
    ]
    for name, (table, _) in zip(("left", "right"), made, strict=True):
        Path(f"{name}.csv").write_text(table)
    write_reconstruction(Path("sparse/0"), [image for _, images in made for image in images])
    page = (Path(__file__).parents[2] / "docs" / "importing.md").read_text(encoding="utf-8")
    block = next(each for each in re.findall(r"```text\n(.*?)```", page, re.DOTALL) if "--target room" in each)
    for command in block.splitlines():
        assert main(command.split()[1:]) == 0, command
    found = read_calibration(latest_run(Path("mycell")) / "calibration.json")
    assert found.verdict == "good"
    base = found.transforms["left_base_from_right_base"]
    off = (base.mean.inverse() @ BASE).log()
    assert off @ np.linalg.solve(base.covariance, off) < 22.46
    (unit,) = (each for each in found.findings if each.code == "unit-length")
    assert float(unit.what.split(" is ")[1].split()[0]) == pytest.approx(1e3 * UNIT_M, rel=0.01)
