"""Gross outliers: whether they are found, clean ones kept, and the base is that of the clean data.

In 30 % of the samples a robot is bumped or has not settled, the view is of another instant, or a reflection is taken as
the light. Or 20 % of the points stray, or have each other's ids. Or both occur: a fifth of the samples are of another
instant, and in a third of the views a tenth of the points are 40 px off.

Gross is at least 8 sigma, whitened by the noise of pixels and robots at the true state. The oracle is the plain solver,
given only the clean data. Unstated robots' noise is estimated, by the oracle too.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from tests.ends import with_eye, with_hand

from basecal.cell import Cell
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.least_squares.studentized_residuals import view_misfits
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers, inlier_problem
from basecal.estimation.outliers.noise_and_outliers import solve_with_noise, with_noise
from basecal.estimation.outliers.robust_solve import RobustSolution, solve_robustly
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import half_turn_views
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.draw import SIZE_PX
from benchmarks.common import label, on_one_core, table, write

BASE = "eye_base_from_hand_base"
SAMPLES, POINTS = 0.3, 0.2
CELLS, CELLS_OF_BOTH = 10, 25
# Of combined faults: samples, views with points that are off, such points of a view, and how far these are off [px].
BOTH_SAMPLES, BOTH_VIEWS, BOTH_POINTS, BOTH_PX = 0.2, 1 / 3, 0.1, 40.0
GROSS_SIGMAS = 8.0
FAR_SIGMAS = 100.0
NEAR_SIGMAS = 16.0
MOST_RATIO, LEAST_FOUND, MOST_LOST = 1.15, 0.97, 0.01
_LARGEST_BUMP = 0.3
_BUMP_TRIES = 200

Rng = np.random.Generator
NOISY = (3e-4, 5e-4)
NOISY_LIGHT = (1e-4, 1e-4)
_BOARD = Scenario(samples=30, robot_noise=NOISY)
_UNSTATED = replace(_BOARD, state_robot_noise=False, state_pixel_noise=False)
_LIGHT = Scenario(samples=40, target="led", camera_mount="fixed", robot_noise=NOISY_LIGHT)


class Corrupted(NamedTuple):
    """A problem with outliers, and the mask of its clean parts."""

    problem: Problem
    clean: InlierMask


Corruption = Callable[[Problem, State, Rng], Corrupted]


def _choose_rows(rng: Rng, count: int, share: float) -> IntArray:
    return np.sort(rng.choice(count, round(share * count), replace=False)).astype(np.int64)


def _one_group(problem: Problem, group: ViewGroup, clean: BoolArray) -> Corrupted:
    """The problem with its only group replaced."""
    return Corrupted(problem.with_groups((group,)), InlierMask((clean,), all_inliers(problem).points))


def _bumps(problem: Problem, truth: State, rng: Rng, rows: IntArray, sigmas: tuple[float, float]) -> Corrupted:
    """Shift a robot's pose in some samples, by a number of sigmas of its effect on the view."""
    group = problem.groups[0]
    moving = [n for n in ("eye", "hand") if len(np.unique(_flanges(group, n).translation, axis=0)) == len(group)]
    clean = np.ones(len(group), dtype=bool)
    for row in rows:
        for _ in range(_BUMP_TRIES):
            tangent = np.concatenate([rng.standard_normal(3), rng.standard_normal(3) * rng.uniform(0, 2)])
            robot = moving[rng.integers(len(moving))]
            size = _bump_size(problem, truth, group, robot, int(row), tangent, rng.uniform(*np.log(sigmas)))
            if size * np.linalg.norm(tangent) < _LARGEST_BUMP:
                break
        group = _with_shifted_pose(group, robot, int(row), size * tangent)
        clean[row] = False
    return _one_group(problem, group, clean)


def _flanges(group: ViewGroup, robot: str) -> SE3:
    return group.eye.base_from_flange if robot == "eye" else group.hand.base_from_flange


def _with_shifted_pose(group: ViewGroup, robot: str, row: int, tangent: Array) -> ViewGroup:
    before = _flanges(group, robot)
    shift = np.zeros((len(group), 6))
    shift[row] = tangent
    after = before @ SE3.exp(shift)
    if robot == "eye":
        return with_eye(group, base_from_flange=after)
    return with_hand(group, base_from_flange=after)


def _bump_size(
    problem: Problem, truth: State, group: ViewGroup, robot: str, row: int, tangent: Array, log_sigmas: float
) -> float:
    """The scale of a bump that moves its view by a number of sigmas, without the noise of the view itself."""
    small = 1e-5 / np.linalg.norm(tangent)
    one = problem.with_groups((group.take(np.array([row])),))
    gradients = []
    for sign in (1, -1):
        shifted = _with_shifted_pose(one.groups[0], robot, 0, sign * small * tangent)
        gradients.append(linearise(one.with_groups((shifted,)), truth).views[0].gradient[0])
    information = linearise(one, truth).views[0].information[0]
    slope = (gradients[0] - gradients[1]) / 2
    slope_sigmas = np.sqrt(max(float(slope @ np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ slope), 1e-300))
    return float(np.exp(log_sigmas) / (slope_sigmas / small))


def bump_robots(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Bump a robot by 8 to 100 sigma."""
    return _bumps(problem, truth, rng, _choose_rows(rng, len(problem.groups[0]), SAMPLES), (GROSS_SIGMAS, FAR_SIGMAS))


def take_unsettled_poses(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Record poses before the arm settled: 8 to 16 sigma."""
    return _bumps(problem, truth, rng, _choose_rows(rng, len(problem.groups[0]), SAMPLES), (GROSS_SIGMAS, NEAR_SIGMAS))


def mispair_views(problem: Problem, truth: State, rng: Rng, share: float = SAMPLES) -> Corrupted:
    """Exchange the views of some samples."""
    group = problem.groups[0]
    rows = rng.permutation(_choose_rows(rng, len(group), share))
    order = np.arange(len(group))
    order[rows] = np.roll(rows, 1)
    reordered = group.take(order)
    swapped = replace(group, measurement=reordered.measurement, readings=reordered.readings)
    result = _one_group(problem, swapped, order == np.arange(len(order)))
    return _without_small_errors(result, truth)


def take_reflections(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Replace the light by a bright spot anywhere in the image."""
    group = problem.groups[0]
    measurement = group.measurement
    assert isinstance(measurement, PixelMeasurement)
    rows = _choose_rows(rng, len(group), SAMPLES)
    pixels = measurement.pixels.copy()
    pixels[rows, 0] = rng.uniform((0, 0), SIZE_PX, (len(rows), 2))
    clean = ~np.isin(np.arange(len(group)), rows)
    return _without_small_errors(
        _one_group(problem, replace(group, measurement=replace(measurement, pixels=pixels)), clean), truth
    )


def _without_small_errors(corrupted: Corrupted, truth: State) -> Corrupted:
    """Leave out corrupted views that are off by less than 8 sigma: they are neither clean nor gross."""
    group, views = corrupted.problem.groups[0], corrupted.clean.views[0]
    squares = view_misfits(corrupted.problem, truth)[0]
    kept = np.flatnonzero(views | (squares.value >= GROSS_SIGMAS**2))
    return Corrupted(
        corrupted.problem.with_groups((group.take(kept),)),
        InlierMask((views[kept],), (corrupted.clean.points[0][kept],)),
    )


def _random_points(problem: Problem, rng: Rng) -> BoolArray:
    """A random fifth of all visible points as a mask, (n, p)."""
    measurement = problem.groups[0].measurement
    assert isinstance(measurement, PixelMeasurement | PointMeasurement)
    seen = np.argwhere(measurement.seen)
    selection = np.zeros(measurement.seen.shape, dtype=bool)
    selection[tuple(seen[_choose_rows(rng, len(seen), POINTS)].T)] = True
    return selection


def _corrupt_points(
    problem: Problem, selection: BoolArray, corrupt: Callable[[Array, BoolArray, Array], Array]
) -> Corrupted:
    """Corrupt some points, (n, p), by `corrupt(values (p, d), selection (p,), weight (p,))` of a view."""
    group = problem.groups[0]
    measurement = group.measurement
    assert isinstance(measurement, PixelMeasurement | PointMeasurement)
    values = (measurement.pixels if isinstance(measurement, PixelMeasurement) else measurement.points_in_camera).copy()
    clean = np.ones(selection.shape, dtype=bool)
    for row in range(len(group)):
        before = values[row].copy()
        values[row] = corrupt(values[row], selection[row], measurement.weight[row])
        off = np.linalg.norm(values[row] - before, axis=-1) * measurement.weight[row]
        values[row] = np.where((off >= GROSS_SIGMAS)[:, None], values[row], before)
        clean[row] = off < GROSS_SIGMAS
    after = _with_values(measurement, values)
    readings = (
        (after, half_turn_views(after)) if isinstance(after, PixelMeasurement) and group.half_turn is not None else ()
    )
    corrupted = replace(group, measurement=after, readings=readings)
    kept = all_inliers(problem)
    return Corrupted(problem.with_groups((corrupted,)), InlierMask(kept.views, (clean,)))


def _with_values(
    measurement: PixelMeasurement | PointMeasurement, values: Array
) -> PixelMeasurement | PointMeasurement:
    if isinstance(measurement, PixelMeasurement):
        return replace(measurement, pixels=values)
    return replace(measurement, points_in_camera=values)


def stray_points(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Shift single points by 8 to 100 sigma."""

    def stray(values: Array, selection: BoolArray, weight: Array) -> Array:
        direction = rng.standard_normal(values.shape)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        sigmas = np.exp(rng.uniform(np.log(GROSS_SIGMAS), np.log(FAR_SIGMAS), len(values)))
        return values + np.where(selection, sigmas / np.maximum(weight, 1e-9), 0.0)[:, None] * direction * 1.0000001

    return _corrupt_points(problem, _random_points(problem, rng), stray)


def permute_ids(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Exchange the ids of points."""

    def permute(values: Array, selection: BoolArray, weight: Array) -> Array:
        rows = rng.permutation(np.flatnonzero(selection))
        out = values.copy()
        out[rows] = values[np.roll(rows, 1)]
        return out

    return _corrupt_points(problem, _random_points(problem, rng), permute)


def mispair_and_stray(problem: Problem, truth: State, rng: Rng) -> Corrupted:
    """Exchange the views of some samples, and shift points of some views by 40 px."""
    samples = mispair_views(problem, truth, rng, BOTH_SAMPLES)
    measurement = samples.problem.groups[0].measurement
    assert isinstance(measurement, PixelMeasurement)
    selection = np.zeros(measurement.seen.shape, dtype=bool)
    for row in _choose_rows(rng, len(selection), BOTH_VIEWS):
        seen = np.flatnonzero(measurement.seen[row])
        selection[row, seen[_choose_rows(rng, len(seen), BOTH_POINTS)]] = True

    def stray(values: Array, selection: BoolArray, weight: Array) -> Array:
        direction = rng.standard_normal(values.shape)
        direction *= BOTH_PX / np.linalg.norm(direction, axis=-1, keepdims=True)
        return values + np.where(selection[:, None], direction, 0.0)

    result = _corrupt_points(samples.problem, selection, stray)
    return Corrupted(result.problem, InlierMask(samples.clean.views, result.clean.points))


CASES: dict[str, tuple[str, Scenario, Corruption]] = {
    "board": ("bumped", _BOARD, bump_robots),
    "board, pixels only": ("bumped", replace(_BOARD, robot_noise=(0, 0)), bump_robots),
    "board, sigmas not stated": ("bumped", replace(_BOARD, robot_noise=(0, 0), state_pixel_noise=False), bump_robots),
    "board at stations": ("bumped", replace(_BOARD, arms="stations"), bump_robots),
    "poses": ("bumped", replace(_BOARD, target="pose"), bump_robots),
    "light, mounts known": ("bumped", replace(_LIGHT, target_mount="fixed"), bump_robots),
    "3-D points": ("not settled", replace(_BOARD, target="points3d"), take_unsettled_poses),
    "board, mount by prior": ("not settled", replace(_BOARD, camera_mount="prior"), take_unsettled_poses),
    "chessboard": ("mispaired", replace(_BOARD, target="chessboard"), mispair_views),
    "board ": ("mispaired", _BOARD, mispair_views),
    "poses ": ("mispaired", replace(_BOARD, target="pose"), mispair_views),
    "light, offset free": ("mispaired", _LIGHT, mispair_views),
    "light, offset free ": ("reflection", _LIGHT, take_reflections),
    "light, mounts known ": ("reflection", replace(_LIGHT, target_mount="fixed"), take_reflections),
    "board  ": ("wrong ids", _BOARD, permute_ids),
    "chessboard ": ("wrong ids", replace(_BOARD, target="chessboard"), permute_ids),
    "board   ": ("strays", _BOARD, stray_points),
    "board, sigmas not stated ": ("strays", replace(_BOARD, robot_noise=(0, 0), state_pixel_noise=False), stray_points),
    "rigid points": ("strays", replace(_BOARD, target="points"), stray_points),
    "3-D points ": ("strays", replace(_BOARD, target="points3d"), stray_points),
    "light, mounts free": ("reflection", replace(_LIGHT, camera_mount="free"), take_reflections),
    "board    ": ("both", _BOARD, mispair_and_stray),
    "chessboard  ": ("both", replace(_BOARD, target="chessboard"), mispair_and_stray),
    "board, sigmas not stated  ": (
        "both",
        replace(_BOARD, robot_noise=(0, 0), state_pixel_noise=False),
        mispair_and_stray,
    ),
    "board, no sigma stated": ("both", _UNSTATED, mispair_and_stray),
}


class Trial(NamedTuple):
    """One cell: errors of the base (m, rad), oracle's and ours, and counts."""

    oracle: tuple[float, float]
    ours: tuple[float, float]
    gross: int
    found: int
    clean_samples: int
    lost_samples: int
    clean_points: int
    lost_points: int
    seconds: float


def trial(name: str, seed: int) -> Trial:
    """Corrupt one cell, and solve it robustly and from its clean part."""
    _, scenario, corrupt = CASES[name]
    simulated = simulate(scenario, seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    truth = State(simulated.truth, simulated.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6)))
    corrupted = corrupt(problem, truth, np.random.default_rng([seed, 7]))
    estimated = bool(problem.unstated) and not scenario.state_robot_noise
    began = time.perf_counter()
    ours = (
        _with_noise(corrupted.problem, simulated.cell)
        if estimated
        else solve_robustly(corrupted.problem, simulated.cell)
    )
    took = time.perf_counter() - began
    settings = Settings(robot_noise="estimated" if estimated else "stated")
    oracle = solve_problem(inlier_problem(corrupted.problem, corrupted.clean), simulated.cell, settings)
    return Trial(
        _error(simulated, oracle.state.transforms[BASE]),
        _error(simulated, ours.solution.state.transforms[BASE]),
        *_counts(corrupted, ours),
        took,
    )


def _with_noise(problem: Problem, cell: Cell) -> RobustSolution:
    """Solve as `calibrate` does if robots state no noise."""
    plain = solve_problem(problem, cell)
    return solve_with_noise(cell, Settings(), plain, with_noise(plain, Settings()))


def _error(simulated: SimulatedCell, base: SE3) -> tuple[float, float]:
    xi = (base.inverse() @ simulated.truth[BASE]).log()
    return float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:]))


def _counts(corrupted: Corrupted, ours: RobustSolution) -> tuple[int, int, int, int, int, int]:
    """Number of gross outliers and of those found; of clean samples and those lost; of clean points and those lost."""
    group = corrupted.problem.groups[0]
    seen = _visible_points(group.measurement)
    left = np.ones(seen.shape, dtype=bool)
    row = {int(number): k for k, number in enumerate(group.sample)}
    for outlier in ours.outliers:
        left[row[outlier.sample], list(outlier.ids) or slice(None)] = False
    views, clean = corrupted.clean.views[0], corrupted.clean.points[0]
    whole = ~left.any(-1)
    bad, good = seen & views[:, None] & ~clean, seen & views[:, None] & clean
    return (
        int((~views).sum() + bad.sum()),
        int((~views & whole).sum() + (bad & ~left).sum()),
        int(views.sum()),
        int((views & whole).sum()),
        int(good.sum()),
        int((good & ~left).sum()),
    )


def _visible_points(measurement: Measurement) -> BoolArray:
    if isinstance(measurement, PoseMeasurement):
        return np.ones((len(measurement.weight), 1), dtype=bool)
    assert isinstance(measurement, PixelMeasurement | PointMeasurement)
    return measurement.seen


def summary(name: str, trials: list[Trial]) -> dict[str, Any]:
    """Statistics of a case."""
    oracle, ours = (np.sqrt(np.mean(np.square([getattr(t, w) for t in trials]), 0)) for w in ("oracle", "ours"))
    gross, found, samples, lost_samples, points, lost_points = np.sum([t[2:8] for t in trials], 0)
    return {
        "outliers": CASES[name][0] if name in CASES else "all",
        "cells": name.strip(),
        "count": len(trials),
        "oracle_mm": 1e3 * oracle[0],
        "oracle_mrad": 1e3 * oracle[1],
        "ratio": float((ours / oracle).max()),
        "found": float(found / gross),
        "lost_samples": float(lost_samples / samples),
        "lost_points": float(lost_points / points),
        "median_ms": 1e3 * float(np.median([t.seconds for t in trials])),
        "slowest_ms": 1e3 * float(max(t.seconds for t in trials)),
    }


_FIGURES = ("ratio", "found", "clean samples lost", "clean points lost", "median [ms]", "slowest [ms]")
HEAD = ("outliers", "cells", "count", "oracle [mm]", "oracle [mrad]", *_FIGURES)


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    shares = tuple(f"{100 * result[key]:.2f} %" for key in ("found", "lost_samples", "lost_points"))
    numbers = f"{result['oracle_mm']:.2f}", f"{result['oracle_mrad']:.2f}", f"{result['ratio']:.3f}"
    times = f"{result['median_ms']:.0f}", f"{result['slowest_ms']:.0f}"
    return (result["outliers"], label(result["cells"]), str(result["count"]), *numbers, *shares, *times)


def main(arguments: list[str]) -> None:
    """Run, print; with all cases write results/outliers.json too, after each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.outliers", description=__doc__)
    parser.add_argument(
        "--cells", type=int, help=f"of each case (default {CELLS}, of both kinds at once {CELLS_OF_BOTH})"
    )
    parser.add_argument("--only", default="", help="cases whose outliers or cells have this in their name")
    parser.add_argument("--first-seed", type=int, default=30000, help="(default 30000: none that anything was set by)")
    parser.add_argument("--shared", action="store_true", help="say of the times that other programs had the cores, too")
    asked = parser.parse_args(arguments)
    on_one_core()
    names = [n for n in CASES if asked.only in f"{CASES[n][0]}: {n}"]
    rows, every = [], []
    for name in names:
        cells = asked.cells or (CELLS_OF_BOTH if CASES[name][0] == "both" else CELLS)
        trials = [trial(name, asked.first_seed + k) for k in range(cells)]
        every += trials
        rows.append(summary(name, trials))
        print("  ".join(row(rows[-1])), flush=True)
        if names == list(CASES):
            write(
                "outliers",
                {
                    "cells": asked.cells or CELLS,
                    "first_seed": asked.first_seed,
                    "shared": asked.shared,
                    "cases": [*rows, summary("all", every)],
                },
            )
    print("\n" + table(HEAD, map(row, [*rows, summary("all", every)])))


if __name__ == "__main__":
    main(sys.argv[1:])
