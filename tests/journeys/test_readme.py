"""Journeys of the README: its commands, typed where only the package is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3
from tests.journeys.raw import (
    MOST_COMMANDS,
    cell,
    is_within_three_sigmas,
    photographs,
    recorded,
    written,
)
from tests.journeys.test_ur import teach_pendant

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NAME = "left_base_from_right_base"
LONGEST_S = 900  # of a command, beside other programs
QUIET_ARMS = (2e-5, 4e-5)  # [m, rad]: so that 0.5 mm is met
Typed = Callable[[str], str]


def commands(title: str) -> list[str]:
    """Commands of the block below a title of the README, with continued lines joined."""
    block = re.search(rf"\*\*{re.escape(title)}\*\*.*?```\w+\n(.*?)```", README, re.DOTALL)
    assert block is not None, title
    lines = block[1].replace("\\\n", "").splitlines()
    assert 0 < len(lines) <= MOST_COMMANDS
    return lines


@pytest.fixture
def typed(tmp_path: Path) -> Typed:
    """Function that runs a line in a shell in an empty folder with an empty home, and returns the output."""
    home = tmp_path / "home"
    home.mkdir()
    path = os.pathsep.join([str(Path(sys.executable).parent), "/usr/bin", "/bin"])

    def run(line: str, *ends: int) -> str:
        found = subprocess.run(
            ["bash", "-c", line],
            cwd=tmp_path,
            env={"PATH": path, "HOME": str(home), "LANG": "C.UTF-8"},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )
        assert found.returncode in (ends or (0,)), f"{line}: {found.returncode}\n{found.stdout}{found.stderr}"
        return found.stdout + found.stderr

    return run


@pytest.fixture
def files(tmp_path: Path) -> SE3:
    """Logs of pendants and photographs of two arms in a folder; and the true base."""
    made = cell(samples=15, seed=3, robot_noise=QUIET_ARMS)
    photographs(made, tmp_path, lambda i: f"IMG_{i + 1}.png")
    for robot, file in (("eye", "left.txt"), ("hand", "right.txt")):
        written(tmp_path / file, teach_pendant(*recorded(made, robot)))
    return made.truth["eye_base_from_hand_base"]


def test_own_images_to_a_pose_for_the_controller(tmp_path: Path, typed: Typed, files: SE3) -> None:
    """The tolerance is met, and the pose for the controller is printed."""
    *before, calibrate, export = commands("Your own images")
    for line in before:
        typed(line)
    assert typed(calibrate).startswith("PASS: ")
    assert re.search(r"^p\[", typed(export), re.MULTILINE)
    assert is_within_three_sigmas(tmp_path / "mycell", NAME, files)


def test_refused_recording_is_fixed(tmp_path: Path, typed: Typed, files: SE3) -> None:
    """Inverted poses of an arm are reported and inverted back, and the answer is correct."""
    lines = (tmp_path / "left.txt").read_text().splitlines()
    turned = [Rotation.from_rotvec(numbers(line)[3:]).inv() for line in lines]
    places = [-turn.apply(numbers(line)[:3]) for turn, line in zip(turned, lines, strict=True)]
    written(tmp_path / "left.txt", teach_pendant(places, Rotation.concatenate(turned)))
    for line in commands("Your own images")[:3]:
        typed(line)
    calibrate, fix, export = commands("A recording that is refused")
    assert typed(calibrate, 4).startswith("REFUSED: ")
    assert "GOOD: " in typed(fix)
    assert re.search(r"^p\[", typed(export), re.MULTILINE)
    assert is_within_three_sigmas(tmp_path / "mycell", NAME, files)


@pytest.mark.slow
def test_install_and_demo(tmp_path: Path, typed: Typed) -> None:
    """From a clone with the system's Python to the demo with a good answer."""
    for name in ("src", "pyproject.toml", "hatch_build.py", "README.md", "LICENSE", "NOTICE", "constraints.txt"):
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, tmp_path / name)
    printed = typed(" && ".join(commands("Install and demo")))
    assert "GOOD: " in printed


def numbers(line: str) -> list[float]:
    """Numbers of p[x, y, z, rx, ry, rz]."""
    return [float(number) for number in line.strip("p[]").split(",")]
