"""All solvers on one cell, and statistics over many cells."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from basecal.geometry import SE3
from benchmarks.peers import by_opencv, by_scipy, ours
from benchmarks.peers.task import Design, Task, make_task

SCIPY = "SciPy, poses"
Result = TypeVar("Result")


class Error(NamedTuple):
    """Errors of a result [mm, mrad], NaN if it failed, and its time [s]."""

    mm: float
    mrad: float
    seconds: float


class Trial(NamedTuple):
    """One cell: errors by name, and the time of `solvePnP` [s].

    `predicted` is the error that our covariance predicts for ours from pixels [mm, mrad].
    """

    errors: dict[str, Error]
    predicted: tuple[float, float]
    pnp_s: float


def trial(design: Design, seed: int) -> Trial:
    """Run all solvers on one cell."""
    task = make_task(design, seed)
    errors, starts = {}, []
    for method, work in by_opencv.works(task, design.name).items():
        chains, took = _timed(work)
        for chain, result in chains.items():
            errors[f"OpenCV {method}{chain}"] = _error(task, None if result is None else result[0], took)
            if result is not None:
                starts.append(tuple(result))
    end, took = _timed(lambda: by_scipy.close_loop(task, starts or [task.truth]))
    errors[SCIPY] = _error(task, end, took)
    predicted = (np.nan, np.nan)
    for name, estimate in ours.works(task).items():
        own, took = _timed(estimate)
        errors[name] = _error(task, own.mean, took)
        if name == ours.PIXELS:
            variance = np.diag(own.covariance)
            predicted = 1e3 * float(np.sqrt(variance[:3].sum())), 1e3 * float(np.sqrt(variance[3:].sum()))
    return Trial(errors, predicted, task.pnp_s)


def _timed(work: Callable[[], Result]) -> tuple[Result, float]:
    began = time.perf_counter()
    result = work()
    return result, time.perf_counter() - began


def _error(task: Task, estimate: SE3 | None, seconds: float) -> Error:
    if estimate is None:
        return Error(np.nan, np.nan, seconds)
    off = estimate.inverse() @ task.truth[0]
    return Error(1e3 * float(np.linalg.norm(off.translation)), 1e3 * float(np.linalg.norm(off.rotvec)), seconds)


def summary(design: Design, trials: list[Trial]) -> dict[str, Any]:
    """A row: errors over all cells by name; failures of a method are counted, and are in no error."""
    predicted = np.sqrt(np.mean(np.square([each.predicted for each in trials]), axis=0))
    return {
        "design": design.name,
        "samples": design.samples,
        "pixel_px": design.pixel_px,
        "robot_mm_mrad": [1e3 * sigma for sigma in design.robot],
        "cells": len(trials),
        "pnp_ms": 1e3 * float(np.median([each.pnp_s for each in trials])),
        "predicted": {"rms_mm": float(predicted[0]), "rms_mrad": float(predicted[1])},
        "methods": {name: _statistics([each.errors[name] for each in trials]) for name in trials[0].errors},
    }


def _statistics(errors: list[Error]) -> dict[str, float | int]:
    values = np.array([each[:2] for each in errors])
    finite = values[np.isfinite(values[:, 0])]
    rms, medians = np.sqrt(np.mean(finite**2, axis=0)), np.median(finite, axis=0)
    return {
        "rms_mm": float(rms[0]),
        "rms_mrad": float(rms[1]),
        "median_mm": float(medians[0]),
        "median_mrad": float(medians[1]),
        "median_ms": 1e3 * float(np.median([each.seconds for each in errors])),
        "failed": len(values) - len(finite),
    }
