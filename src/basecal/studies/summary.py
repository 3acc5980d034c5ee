"""Summary of a study at each point, as the plain data of `summary.json`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtri

from basecal.errors import InputError
from basecal.geometry import Array
from basecal.studies.chunk import COLUMNS, ChunkResult, Trials, read_chunk
from basecal.studies.columns import quantiles, write_columns
from basecal.studies.study import Chunk, Point, Study, axis_label

SCHEMA = "basecal/study-result/1"
COVERAGE = 0.95
"""Probability of the ellipsoids that a covariance predicts; the truth should lie inside this often."""
_ROWS = 100_000  # rows of a batch: some tens of megabytes


def summarise(study: Study, folder: Path) -> dict[str, Any]:
    """Summarise the results of a study at each point; quantities that were not computed are None.

    Raises:
        InputError: if a chunk is missing.
    """
    points = []
    for point, group in itertools.groupby(results(study, folder), key=lambda each: each[0].point):
        chunk_results = [result for _, result in group]
        joined = {name: np.concatenate([getattr(result.trials, name) for result in chunk_results]) for name in COLUMNS}
        reasons = dict.fromkeys(reason for result in chunk_results for reason in result.reasons)
        points.append(_point_summary(point, Trials(**joined), list(reasons)))
    return {
        "schema": SCHEMA,
        "title": study.title,
        "about": study.about,
        "seed": study.seed,
        "trials": study.trials,
        "cells": study.cells,
        "transform": study.transform,
        "study": f"sha256:{study.identity}",
        "axes": {name: [axis_label(value) for value in values] for name, values in study.axes.items()},
        "points": points,
    }


def _point_summary(point: Point, trials: Trials, reasons: list[str]) -> dict[str, Any]:
    solved = trials.solved
    nees, directions = trials.nees[solved], trials.directions[solved]
    has_covariances = bool(len(nees)) and bool(np.all(directions > 0))
    inside = nees <= chdtri(np.maximum(directions, 1), 1 - COVERAGE) if has_covariances else np.zeros(0)
    standard_error = (
        float(nees.std(ddof=1) / np.sqrt(len(nees))) if has_covariances and len(nees) > 1 else None
    )  # of the mean
    return {
        "at": point.label,
        "trials": len(solved),
        "solved": int(solved.sum()),
        "error_mm": _spread(trials.error_mm[solved]),
        "error_deg": _spread(trials.error_deg[solved]),
        "sigma_mm": _rms(trials.sigma_mm[solved]),
        "sigma_deg": _rms(trials.sigma_deg[solved]),
        "nees": {"mean": float(nees.mean()), "expected": int(directions[0]), "standard_error": standard_error}
        if has_covariances
        else None,
        "coverage": {"share": float(inside.mean()), "expected": COVERAGE} if has_covariances else None,
        "time_s": float(trials.time_s.mean()),
        "reasons": reasons,
    }


def _spread(errors: Array) -> dict[str, float] | None:
    """Quantiles and root mean square of errors; None without solutions."""
    if not len(errors):
        return None
    return {**quantiles(errors), "rms": float(np.sqrt(np.mean(errors**2)))}


def _rms(sigmas: Array) -> float | None:
    return float(np.sqrt(np.mean(sigmas**2))) if len(sigmas) and np.isfinite(sigmas).all() else None


def results(study: Study, folder: Path) -> Iterator[tuple[Chunk, ChunkResult]]:
    """Results of each chunk, in the study's order.

    Raises:
        InputError: if a chunk is missing.
    """
    for chunk in study.chunks:
        result = read_chunk(folder, study, chunk)
        if result is None:
            raise InputError(f"{folder} lacks the trials of chunk {chunk.index}: run the study again to complete it")
        yield chunk, result


def write_table(study: Study, folder: Path) -> Path:
    """Write a table with a row for each trial into the study's folder, with the axes' values first; its path.

    Raises:
        InputError: if a chunk is missing, or the file cannot be written.
    """
    return write_columns(folder, _batches(study, folder))


def _batches(study: Study, folder: Path) -> Iterator[dict[str, Any]]:
    """Columns of consecutive trials, in batches of about `_ROWS` rows."""
    batch: list[tuple[Chunk, ChunkResult]] = []
    for each in results(study, folder):
        batch.append(each)
        if sum(chunk.trials for chunk, _ in batch) >= _ROWS:
            yield _columns(study, batch)
            batch = []
    if batch:
        yield _columns(study, batch)


def _columns(study: Study, results: list[tuple[Chunk, ChunkResult]]) -> dict[str, Any]:
    axes = {
        name: [label for chunk, _ in results for label in [chunk.point.label[name]] * chunk.trials]
        for name in study.axes
    }
    return axes | {name: np.concatenate([getattr(result.trials, name) for _, result in results]) for name in COLUMNS}
