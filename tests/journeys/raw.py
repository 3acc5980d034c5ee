"""Raw files as users have them: images of a simulated cell, and its robots' poses in the words of other tools.

Poses are written with SciPy's rotations, not with the code that reads them.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from basecal.cell.files import latest_run, read_calibration
from basecal.cell.targets.charuco import charuco_target
from basecal.cli import main
from basecal.geometry import SE3, Array, Camera
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.images import render_recording

LENS = Camera("pinhole", np.array([620.0, 622.0, 318.0, 242.0, -0.08, 0.05, 0.0, 0.0, 0.0]), (640, 480))
BOARD = charuco_target((5, 7), 0.03, 0.0225, "DICT_4X4_50")
BOARD_OPTIONS = "--target charuco --squares 5x7 --square 30mm --marker 22.5mm"
NOISE = (1e-4, 2e-4)  # [m, rad] of a flange: repeatability as makers state it
MOST_COMMANDS = 5
THREE_SIGMAS = 0.0027  # chance of an error beyond three sigmas, of one number
FIRST_STAMP_NS = 1_682_512_345_000_000_000


def cell(samples: int, seed: int, **kept: object) -> SimulatedCell:
    """Two arms, a camera on the first, a board on the second, as `Scenario` says otherwise."""
    told = {"camera": LENS, "board": BOARD, "distance_m": (0.35, 0.55), "robot_noise": NOISE}
    return simulate(Scenario(samples=samples, **{**told, **kept}), seed)  # type: ignore[arg-type]


def photographs(made: SimulatedCell, folder: Path, name: Callable[[int], str]) -> None:
    """Images of every sample in a folder, by the names that a camera's program gives them."""
    recording = render_recording(made, folder / "rendered")
    (folder / "photos").mkdir()
    for i, sample in enumerate(recording.samples):
        (path,) = sample.images.values()
        (folder / "rendered" / path).rename(folder / "photos" / name(i))


def recorded(made: SimulatedCell, robot: str) -> tuple[Array, Rotation]:
    """What a robot said of its flange: positions (n, 3) [m], and rotations."""
    poses = [sample.robots[robot].base_from_flange for sample in made.recording.samples]
    held = [pose for pose in poses if pose is not None]
    return np.array([p.translation for p in held]), Rotation.from_matrix([p.rotation for p in held])


def run(*commands: str) -> None:
    """The commands of a user, one after the other: no more than were promised, each ending well."""
    assert len(commands) <= MOST_COMMANDS
    for command in commands:
        program, *words = shlex.split(command)
        assert program == "basecal"
        assert main(words) == 0, command


def squared_error(place: Path, name: str, truth: SE3) -> float:
    """The squared Mahalanobis distance of a found transform from the truth."""
    run_folder = latest_run(place)
    assert run_folder is not None
    found = read_calibration(run_folder)[name]
    error = (found.mean.inverse() @ truth).log()
    return float(error @ np.linalg.solve(found.covariance, error))


def is_within_three_sigmas(place: Path, name: str, truth: SE3) -> bool:
    """Whether an error of six numbers is no rarer than three sigmas of one number are."""
    return squared_error(place, name, truth) < chi2.isf(THREE_SIGMAS, 6)


def is_pasted(pasted: SE3, place: Path, name: str) -> bool:
    """Whether what was pasted is what was found, to the digits that are pasted: a tenth of a sigma of every number."""
    run_folder = latest_run(place)
    assert run_folder is not None
    found = read_calibration(run_folder)[name]
    off = (found.mean.inverse() @ pasted).log()
    return bool(np.all(np.abs(off) < 0.1 * np.sqrt(np.diag(found.covariance))))


def written(path: Path, lines: Sequence[str]) -> None:
    """A file of lines."""
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
