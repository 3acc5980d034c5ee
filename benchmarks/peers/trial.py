"""Everybody on one cell, and what many cells say."""

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
    """How far a result is off [mm, mrad], NaN where there is none, and how long it took [s]."""

    mm: float
    mrad: float
    seconds: float


class Trial(NamedTuple):
    """One cell: errors by name, what our covariance predicts of ours from pixels [mm, mrad], time of `solvePnP` [s]."""

    errors: dict[str, Error]
    predicted: tuple[float, float]
    pnp_s: float


def trial(design: Design, seed: int) -> Trial:
    """Everybody on one cell."""
    task = make_task(design, seed)
    errors, starts = {}, []
    for method, work in by_opencv.works(task, design.name).items():
        chains, took = _timed(work)
        for chain, found in chains.items():
            errors[f"OpenCV {method}{chain}"] = _error(task, None if found is None else found[0], took)
            if found is not None:
                starts.append(tuple(found))
    end, took = _timed(lambda: by_scipy.solved(task, starts or [task.truth]))
    errors[SCIPY] = _error(task, end, took)
    predicted = (np.nan, np.nan)
    for name, estimate in ours.works(task).items():
        mine, took = _timed(estimate)
        errors[name] = _error(task, mine.mean, took)
        if name == ours.PIXELS:
            variance = np.diag(mine.covariance)
            predicted = 1e3 * float(np.sqrt(variance[:3].sum())), 1e3 * float(np.sqrt(variance[3:].sum()))
    return Trial(errors, predicted, task.pnp_s)


def _timed(work: Callable[[], Result]) -> tuple[Result, float]:
    began = time.perf_counter()
    result = work()
    return result, time.perf_counter() - began


def _error(task: Task, found: SE3 | None, seconds: float) -> Error:
    if found is None:
        return Error(np.nan, np.nan, seconds)
    off = found.inverse() @ task.truth[0]
    return Error(1e3 * float(np.linalg.norm(off.translation)), 1e3 * float(np.linalg.norm(off.rotvec)), seconds)


def summary(design: Design, trials: list[Trial]) -> dict[str, Any]:
    """A row: errors over all cells by name; a method's failures are counted, and in no error."""
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
    there = values[np.isfinite(values[:, 0])]
    rms, middle = np.sqrt(np.mean(there**2, axis=0)), np.median(there, axis=0)
    return {
        "rms_mm": float(rms[0]),
        "rms_mrad": float(rms[1]),
        "median_mm": float(middle[0]),
        "median_mrad": float(middle[1]),
        "median_ms": 1e3 * float(np.median([each.seconds for each in errors])),
        "failed": len(values) - len(there),
    }
