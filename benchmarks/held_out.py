"""Real recordings: held-out error compared with the best of OpenCV's seven methods, and agreement of halves.

For recordings of one robot, one camera and one target. Held-out error: each fold is left out in turn. Each of its views
and the calibrated mount give a pose of the target, in the base, or in the flange if the camera is beside the robot.
It is compared with the mean over the views that were not left out, rms over all folds. OpenCV has the same folds, its
lens from `calibrateCamera` if none is stated, and the best of its seven methods in hindsight.

Halves: squared Mahalanobis distance between the mounts of two halves of the samples (median 5.3 if covariances are
true). Halves are drawn at random, or divided by the place of the flange. The latter share less of an arm's errors that
are smooth in its pose.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import cv2
import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell, Observation, PixelObservation, PoseObservation, Recording
from basecal.errors import DatasetError
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.rotation import nearest_rotation
from benchmarks.calibrate import recordings
from benchmarks.common import on_one_core, table, write
from benchmarks.peers.by_opencv import METHODS, one_arm

NAMES = (
    "rct_charuco",
    "kuka_1_chessboard",
    "rct_10x10",
    "ur3e_88_images",
    "visp_franka_in_hand",
    "visp_franka_to_hand",
    "moveit_pose_samples",
)
FOLDS = 3
FEWEST_POINTS = 4  # of a plane, whose pose they give
MOST_RATIO, MOST_M2 = 1.05, 11.0
HEAD = ("recording", "samples", "ours [mm]", "[deg]", "OpenCV's best", "[mm]", "[deg]", "ratio mm", "ratio deg",
        "halves, random", "blocked", "verdicts")  # fmt: skip

Errors = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Task:
    """A recording of one robot, one camera and one target, one view a sample.

    Attributes:
        cell: As declared.
        recording: As recorded.
        mount: Name of the camera's mount.
        arm: (n,) left factor of the mount: base_from_flange, or its inverse if the camera is beside the robot.
        seen: The view of each sample.
        lens: As stated; None if it is free, or if poses were measured.
    """

    cell: Cell
    recording: Recording
    mount: str
    arm: SE3
    views: Sequence[PixelObservation | PoseObservation]
    lens: Camera | None

    def part(self, keep: BoolArray) -> Recording:
        """The samples that are kept."""
        return replace(self.recording, samples=tuple(s for s, k in zip(self.recording.samples, keep, strict=True) if k))


def make_task(cell: Cell, recording: Recording) -> Task:
    """The task of a cell: its samples with a view, in the order of the recording."""
    samples = tuple(s for s in recording.samples if s.observations and _has_pose(s.observations[0]))
    (name, camera), robot = next(iter(cell.cameras.items())), cell.reference
    poses = [s.robots[robot].base_from_flange for s in samples]
    arm = SE3.stack([pose for pose in poses if pose is not None])
    views = [s.observations[0] for s in samples]
    views = [o for o in views if isinstance(o, PixelObservation | PoseObservation)]
    fixed = camera.intrinsics is not None and camera.intrinsics.status == "fixed"
    lens = camera.intrinsics.camera if camera.intrinsics is not None and fixed else None
    on_robot = camera.on == robot
    recorded = replace(recording, samples=samples)
    return Task(cell, recorded, cell.mount_name(name), arm if on_robot else arm.inverse(), views, lens)


def _has_pose(view: Observation) -> bool:
    """Whether a view alone gives the target's pose."""
    return isinstance(view, PoseObservation) or (isinstance(view, PixelObservation) and len(view.ids) >= FEWEST_POINTS)


def _points(task: Task, view: PixelObservation) -> Array:
    shape = task.cell.targets[view.target].target
    assert shape is not None
    rows = {int(number): row for row, number in enumerate(shape.ids)}
    return np.asarray(shape.points[[rows[int(k)] for k in view.ids]])


def _poses(task: Task, lens: Camera | None) -> SE3:
    """camera_from_target of every view alone, (n,)."""
    poses = []
    for view in task.views:
        if isinstance(view, PoseObservation):
            poses.append(view.camera_from_target)
            continue
        assert lens is not None
        _, turn, place = cv2.solvePnP(_points(task, view), view.pixels, _matrix(lens), np.array(lens.distortion))
        poses.append(SE3.from_rotvec(turn.ravel(), place.ravel()))
    return SE3.stack(poses)


def _matrix(lens: Camera) -> Array:
    fx, fy, cx, cy = lens.parameters[:4]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def _errors(task: Task, poses: SE3, mount: SE3, train: BoolArray) -> Errors:
    """Rms distance of target poses from held-out views to the mean of the others [mm, deg]."""
    target_poses = task.arm @ mount @ poses
    mean = SE3(nearest_rotation(target_poses.rotation[train].sum(0)), target_poses.translation[train].mean(0))
    off = mean.inverse() @ target_poses[np.flatnonzero(~train)]
    length, angle = np.linalg.norm(target_poses.translation[~train] - mean.translation, axis=-1), off.rotvec
    return 1e3 * float(np.sqrt(np.mean(length**2))), float(np.degrees(np.sqrt(np.mean(np.sum(angle**2, -1)))))


def _ours(task: Task, train: BoolArray) -> tuple[Calibration, Errors | None]:
    calibration = calibrate(task.cell, task.part(train))
    if task.mount not in calibration.transforms:
        return calibration, None
    lens = next((lens for lens, _ in calibration.cameras.values()), task.lens)
    return calibration, _errors(task, _poses(task, lens), calibration[task.mount].mean, train)


def _opencv(task: Task, train: BoolArray) -> dict[str, Errors]:
    poses, rows = _poses(task, task.lens or _lens_by_opencv(task, train)), np.flatnonzero(train)
    results = {method: one_arm(method, task.arm[rows], poses[rows]) for method in METHODS}
    return {m: _errors(task, poses, each.flange_from_camera, train) for m, each in results.items() if each is not None}


def _lens_by_opencv(task: Task, train: BoolArray) -> Camera | None:
    camera = next(iter(task.cell.cameras.values()))
    views = [v for v, k in zip(task.views, train, strict=True) if k and isinstance(v, PixelObservation)]
    if not views or camera.size_px is None:
        return None
    points = [_points(task, v).astype(np.float32) for v in views]
    pixels = [v.pixels.astype(np.float32)[:, None] for v in views]
    _, k, d, _, _ = cv2.calibrateCamera(points, pixels, camera.size_px, np.eye(3), np.zeros(5))
    return Camera("pinhole", np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2], *d.ravel()]), camera.size_px)


def _half_distance(task: Task, keep: BoolArray) -> float | None:
    """Squared Mahalanobis distance between the mounts of the kept samples and of the others; None if one is missing."""
    first, second = (calibrate(task.cell, task.part(k)) for k in (keep, ~keep))
    if task.mount not in first.transforms or task.mount not in second.transforms:
        return None
    a, b = first[task.mount], second[task.mount]
    step = a.mean.inverse() @ b.mean
    xi, covariance = step.log(), step.adjoint() @ b.covariance @ step.adjoint().T
    return float(xi @ np.linalg.solve(a.covariance + covariance, xi))


def _rms(errors: Sequence[Errors]) -> Errors:
    mm, deg = np.sqrt(np.mean(np.square(errors), axis=0))
    return float(mm), float(deg)


def _cross_validate(task: Task, rng: np.random.Generator) -> dict[str, Any]:
    """Errors and verdicts over one division into folds."""
    n = len(task.views)
    order, ours, peers, verdicts = rng.permutation(n), [], {m: [] for m in METHODS}, []
    for fold in range(FOLDS):
        train = np.ones(n, dtype=bool)
        train[order[fold::FOLDS]] = False
        calibration, errors = _ours(task, train)
        verdicts.append(calibration.verdict)
        ours += [] if errors is None else [errors]
        for method, each in _opencv(task, train).items():
            peers[method].append(each)
    complete = {m: _rms(each) for m, each in peers.items() if len(each) == FOLDS}
    best = min(complete, key=lambda m: complete[m][0])
    ours_rms = _rms(ours) if len(ours) == FOLDS else (np.nan, np.nan)
    return {"ours": ours_rms, "method": best, "opencv": complete[best], "verdicts": verdicts}


def measure(name: str, task: Task, shuffles: int, halves: int) -> dict[str, Any]:
    """Errors of the median division, medians of the ratios over all, and distances of halves."""
    rng, n = np.random.default_rng(0), len(task.views)
    runs = [_cross_validate(task, rng) for _ in range(shuffles)]
    ratios = [np.divide(run["ours"], run["opencv"]) for run in runs]
    middle = sorted(range(shuffles), key=lambda k: ratios[k][0])[shuffles // 2]
    random, blocked = [], []
    for _ in range(halves):
        keep = np.zeros(n, dtype=bool)
        keep[rng.permutation(n)[: n // 2]] = True
        random.append(_half_distance(task, keep))
        along = task.arm.translation @ rng.standard_normal(3)
        blocked.append(_half_distance(task, along < np.median(along)))
    mm, deg = np.median(ratios, axis=0)
    return {
        "recording": name,
        "samples": n,
        **runs[middle],
        "ratio_mm": float(mm),
        "ratio_deg": float(deg),
        "random_m2": median(m for m in random if m is not None) if any(m is not None for m in random) else None,
        "blocked_m2": median(m for m in blocked if m is not None) if any(m is not None for m in blocked) else None,
        "verdicts": sorted({v for run in runs for v in run["verdicts"]}),
    }


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    halves = ("none" if result[k] is None else f"{result[k]:.1f}" for k in ("random_m2", "blocked_m2"))
    ours, theirs = ([f"{each:.3g}" for each in result[k]] for k in ("ours", "opencv"))
    ratios = f"{result['ratio_mm']:.2f}", f"{result['ratio_deg']:.2f}"
    name, count = result["recording"], str(result["samples"])
    return name, count, *ours, result["method"], *theirs, *ratios, *halves, ", ".join(result["verdicts"])


def main(arguments: list[str]) -> None:
    """Measure and print; if all were measured, write results/held_out.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.held_out", description=__doc__)
    parser.add_argument("--recordings", nargs="*", default=list(NAMES), choices=list(NAMES), metavar="NAME")
    parser.add_argument("--shuffles", type=int, default=5, help="divisions into folds, of which the median counts")
    parser.add_argument("--halves", type=int, default=9, help="divisions into halves of each kind")
    asked = parser.parse_args(arguments)
    on_one_core()
    readers: dict[str, Callable[[], tuple[Cell, Recording]]] = recordings()
    rows = []
    for name in asked.recordings:
        try:
            rows.append(measure(name, make_task(*readers[name]()), asked.shuffles, asked.halves))
            print(", ".join(row(rows[-1])), flush=True)
        except DatasetError as error:
            print(f"left out: {error}")
    print(table(HEAD, map(row, rows)))
    if [result["recording"] for result in rows] == list(NAMES):
        write("held_out", {"rows": rows, "shuffles": asked.shuffles, "halves": asked.halves})


if __name__ == "__main__":
    main(sys.argv[1:])
