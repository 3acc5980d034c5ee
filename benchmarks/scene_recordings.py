"""A scene in place of the board: real recordings with masked boards, compared with the results from the boards.

Features in the hull of each board, and 30 % around it, are left out. The camera's mount from the scene is compared with
that from the board, by the Mahalanobis distance in the sum of both covariances. Two halves of a recording serve as two
arms, whose relative base is the identity. Recordings without texture beside the board must be refused.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any
from unittest.mock import patch

import numpy as np
from tests.shared.real_recordings import EXAMPLES, data_folder

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.scene import images
from basecal.cell import Calibration, Cell, PixelObservation, Recording, Sample, Unknown
from basecal.cell.files import read_cell, read_recording
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, PoseEstimate
from basecal.vision.detect import detect
from benchmarks.common import Kept, cpu_seconds, on_one_core, table, write

UR5E = "ur5e_dual_charuco_2023"
RECORDINGS = "kuka_1_chessboard", UR5E, "rct_10x10", "ur3e_88_images", "visp_franka_in_hand"
HALVES = "kuka_1_chessboard"
HEAD = "recording", "what", "verdict", "mm", "deg", "M2", "own sigma [mm]", "[deg]", "refused as", "CPU time [s]"


def board_pixels(cell: Cell, sample: Sample, camera: str) -> list[Array]:
    """Pixels of each target that an image shows."""
    observations = (each for each in sample.observations if isinstance(each, PixelObservation))
    return [each.pixels for each in observations if each.camera == camera]


def calibrate_from_scene(cell: Cell, recording: Recording) -> tuple[Calibration, float]:
    """The answer from the scene with boards masked, without bases of robots that have no camera, and CPU time [s]."""
    answers: list[Calibration] = []
    idle = cell.robots.keys() - {cell.reference, *(camera.on for camera in cell.cameras.values())}
    cell = replace(cell, bases={**cell.bases, **dict.fromkeys(idle, Unknown("fixed", SE3.identity()))})
    with patch.object(images, "_moving_targets", board_pixels):
        cpu_s = cpu_seconds(lambda: answers.append(calibrate(cell, recording, Settings(method="scene"))))
    return answers[0], cpu_s


def result_line(what: str, answer: Calibration, cpu_s: float, name: str, reference: PoseEstimate) -> dict[str, Any]:
    """A line of results: the distance of a transform from a reference, and its sigma."""
    codes = [each.code for each in answer.findings if each.severity == "error"]
    line: dict[str, Any] = {"what": what, "verdict": answer.verdict, "errors": codes, "cpu_s": cpu_s}
    if name not in answer.transforms:
        return line
    estimate = answer.transforms[name]
    off = (reference.mean.inverse() @ estimate.mean).log()
    variance = np.diag(estimate.covariance)
    return line | {
        "mm": 1e3 * float(np.linalg.norm(off[:3])),
        "deg": float(np.degrees(np.linalg.norm(off[3:]))),
        "m2": float(off @ np.linalg.solve(estimate.covariance + reference.covariance, off)),
        "sigma_mm": 1e3 * float(np.sqrt(variance[:3].sum())),
        "sigma_deg": float(np.degrees(np.sqrt(variance[3:].sum()))),
    }


def as_two_arms(cell: Cell, recording: Recording) -> tuple[Cell, Recording]:
    """Every other sample as one of a second arm with its own camera, whose base is that of the first."""
    robot, camera = next(iter(cell.robots)), next(iter(cell.cameras))
    data = cell_to_dict(cell)
    data["robots"]["second"] = dict(data["robots"][robot])
    data["cameras"]["second_eye"] = {**data["cameras"][camera], "on": "second"}
    data["bases"] = {"second": {"status": "free"}}
    samples = [
        sample
        if k % 2 == 0
        else replace(
            sample,
            robots={"second": sample.robots[robot]},
            images={"second_eye": sample.images[camera]},
            observations=tuple(
                replace(each, camera="second_eye") for each in sample.observations if isinstance(each, PixelObservation)
            ),
        )
        for k, sample in enumerate(recording.samples)
    ]
    return cell_from_dict(data), replace(recording, samples=tuple(samples))


def read_with_boards(name: str, home: Path) -> tuple[Cell, Recording]:
    """A copy of a recording with detected boards; that of two UR5e is the example with the published images."""
    folder = Path(copytree(EXAMPLES / "ur5e_dual" if name == UR5E else data_folder() / name, home / name))
    cell = read_cell(folder)
    recording = read_recording(folder, cell)
    if name != UR5E:
        return cell, detect(cell, recording)
    copytree(data_folder() / UR5E / "images", folder / "recording" / "images")
    camera = next(iter(cell.cameras))
    samples = [
        replace(sample, images={camera: f"recording/images/{sample.sample:03d}_image.jpg"})
        for sample in recording.samples
    ]
    return cell, replace(recording, samples=tuple(samples))


def trial(name: str) -> list[dict[str, Any]]:
    """Lines of results of one recording."""
    with tempfile.TemporaryDirectory() as home:
        cell, recording = read_with_boards(name, Path(home))
        mount = cell.mount_name(next(iter(cell.cameras)))
        board = calibrate(cell, recording)
        answer, cpu_s = calibrate_from_scene(cell, recording)
        lines = [result_line("mount, lens free", answer, cpu_s, mount, board.transforms[mount])]
        if name == HALVES:
            halves, split = as_two_arms(cell, recording)
            answer, cpu_s = calibrate_from_scene(halves, split)
            base = halves.base_name("second")
            exact = PoseEstimate(SE3.identity(), np.zeros((6, 6)))
            lines.append(result_line("base, halves as two arms", answer, cpu_s, base, exact))
        return [{"recording": name, **line} for line in lines]


def row(line: dict[str, Any]) -> list[str]:
    """A line of the table with `HEAD`."""
    numbers = ["mm", "deg", "m2", "sigma_mm", "sigma_deg"]
    texts = [f"{line[key]:.2g}" if key in line else "-" for key in numbers]
    refused = ", ".join(line["errors"]) or "-"
    return [line["recording"], line["what"], line["verdict"], *texts, refused, f"{line['cpu_s']:.0f}"]


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = """\
Real recordings of one arm, with the board and 30 % more around it masked, are compared with the result from the board.
M2 is in the sum of both covariances. Two halves of a recording serve as two arms. They are of one arm, so that the true
base is the identity."""
    return f"{about}\n\n{table(HEAD, map(row, result['lines']))}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is not kept yet, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", nargs="+", choices=RECORDINGS, default=RECORDINGS)
    parser.add_argument("--keep", type=Path, help="file in which recordings are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    lines = [line for name in asked.recordings for line in kept.of(name, lambda name=name: trial(name))]
    print(section({"lines": lines}))
    write("scene_recordings", {"lines": lines})
    return 0


if __name__ == "__main__":
    sys.exit(main())
