"""Computation of a chunk of a study, and the file of its results."""

from __future__ import annotations

import io
import json
import time
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from basecal.cell.format.writing import write_atomically
from basecal.errors import BasecalError, DatasetError, printable
from basecal.exchange.npz import read_arrays
from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.studies.draws import DrawnCell, draw, draw_cell
from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.solvers.solver import Answers, no_answers
from basecal.studies.study import Chunk, Piece, Study


@dataclass(frozen=True, eq=False)
class Trials:
    """Results of trials, (n,) each; NaN if there is no solution, or no covariance.

    Attributes:
        point: Index of the point in the study.
        trial: Number of the trial within its point.
        cell: Number of the cell.
        error_mm: Norm of the translation error, in the axes of the transform's source [mm].
        error_deg: Angle of the rotation error [deg].
        sigma_mm: Root of the summed predicted variances of the translation [mm].
        sigma_deg: Root of the summed predicted variances of the rotation [deg].
        nees: Normalised estimation error squared, over all directions of the transform.
        directions: Number of directions of the transform; 0 without a covariance.
        solved: Whether there is a solution.
        time_s: Wall time of drawing and solving, divided evenly among the trials of a batch [s].
    """

    point: IntArray
    trial: IntArray
    cell: IntArray
    error_mm: Array
    error_deg: Array
    sigma_mm: Array
    sigma_deg: Array
    nees: Array
    directions: IntArray
    solved: BoolArray
    time_s: Array


COLUMNS = tuple(f.name for f in fields(Trials))
_COLUMN_TYPES = {"point": np.int64, "trial": np.int64, "cell": np.int64, "directions": np.int64, "solved": np.bool_}


@dataclass(frozen=True, eq=False)
class ChunkResult:
    """The trials of a chunk, and the reasons of failed trials."""

    trials: Trials
    reasons: tuple[str, ...]


def compute_chunk(study: Study, chunk: Chunk) -> ChunkResult:
    """Compute a chunk; except for times, the result is the same for any worker."""
    parts, reasons, cells = [], dict[str, None](), dict[int, DrawnCell]()
    for piece in chunk.pieces:
        begin = time.perf_counter()
        try:
            if piece.cell not in cells:
                cells[piece.cell] = draw_cell(chunk.point.settings, study.seed, piece.cell, study.transform)
            draws = draw(cells[piece.cell], chunk.point.settings, (study.seed, piece.cell, piece.block), piece.count)
            answers = SOLVERS[chunk.point.settings["solver"]].solve(draws)
            truth = draws.truth
        except BasecalError as error:  # a cell that cannot be simulated counts as failed trials
            answers, truth = no_answers(piece.count, str(error)), SE3.identity()
        time_s = (time.perf_counter() - begin) / piece.count
        parts.append(_evaluate_answers(chunk, piece, answers, truth, time_s))
        if answers.reason:
            reasons[answers.reason] = None
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
    return ChunkResult(Trials(**joined), tuple(reasons))


def _evaluate_answers(chunk: Chunk, piece: Piece, answers: Answers, truth: SE3, time_s: float) -> Trials:
    """Compare solutions with the truth, in millimetres, degrees and predicted sigmas."""
    n, covariance = piece.count, answers.covariance
    error = (answers.transform.inverse() @ truth).log()
    width = 0 if covariance is None else covariance.shape[-1]
    sigmas, nees = np.full((n, 2), np.nan), np.full(n, np.nan)
    if covariance is not None:
        regular = np.where(answers.solved[:, None, None], covariance, np.eye(width))
        variances = np.diagonal(regular, axis1=-2, axis2=-1)
        sigmas = np.sqrt(np.stack([variances[:, :3].sum(-1), variances[:, 3:].sum(-1)], -1))
        nees = np.sum(error[:, :width] * np.linalg.solve(regular, error[:, :width, None])[..., 0], axis=-1)
    lengths = [np.linalg.norm(part, axis=-1) for part in (error[:, :3], error[:, 3:])]
    numbers = {
        "error_mm": 1e3 * lengths[0],
        "error_deg": np.degrees(lengths[1]),
        "sigma_mm": 1e3 * sigmas[:, 0],
        "sigma_deg": np.degrees(sigmas[:, 1]),
        "nees": nees,
    }
    return Trials(
        point=np.full(n, chunk.point.index),
        trial=np.arange(piece.first, piece.first + n),
        cell=np.full(n, piece.cell),
        **{name: np.where(answers.solved, values, np.nan) for name, values in numbers.items()},
        directions=np.full(n, width),
        solved=answers.solved,
        time_s=np.full(n, time_s),
    )


def chunk_path(folder: Path, chunk: Chunk) -> Path:
    """Path of a chunk's file in the study's folder."""
    return folder / "chunks" / f"{chunk.index:06d}.npz"


def pack_result(study: Study, result: ChunkResult) -> bytes:
    """Encode the result of a chunk as the content of its file."""
    stream = io.BytesIO()
    about = json.dumps({"study": study.identity, "reasons": result.reasons})
    columns = vars(result.trials) | {"solved": result.trials.solved.astype(np.uint8)}
    np.savez(stream, about=np.frombuffer(about.encode(), dtype=np.uint8), **columns)
    return stream.getvalue()


def store_chunk(folder: Path, chunk: Chunk, content: bytes) -> None:
    """Write a chunk's file atomically.

    Raises:
        InputError: if the file cannot be written.
    """
    write_atomically(chunk_path(folder, chunk), content, base_folder=folder)


def read_chunk(folder: Path, study: Study, chunk: Chunk) -> ChunkResult | None:
    """Read a chunk's file; None if it is missing, damaged or from another study."""
    try:
        _, arrays = read_arrays(str(chunk_path(folder, chunk)))
        about = json.loads(arrays.pop("about").astype(np.uint8).tobytes())
        if about["study"] != study.identity or any(array.shape != (chunk.trials,) for array in arrays.values()):
            return None
        trials = Trials(**{name: arrays[name].astype(_COLUMN_TYPES.get(name, np.float64)) for name in COLUMNS})
        return ChunkResult(trials, tuple(printable(str(reason)) for reason in about["reasons"]))
    except (DatasetError, ValueError, KeyError, TypeError, RecursionError):
        return None
