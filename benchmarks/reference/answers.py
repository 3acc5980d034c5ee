"""Stored form of an answer, and differences between two answers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.errors import BasecalError
from basecal.geometry import SE3, PoseEstimate
from benchmarks.reference.cases import cases

DIGITS = 12
SIGMAS = 1e-3  # by which a transform may differ
SHARE = 1e-3  # by which a sigma may differ
_UPPER = np.triu_indices(6)

Answer = dict[str, Any]


def answer(name: str) -> Answer:
    """The verdict, findings and transforms of a case; the name of the error if calibration raises one."""
    try:
        calibration = calibrate(*cases()[name]())
    except BasecalError as error:
        return {"verdict": type(error).__name__, "findings": [], "transforms": {}}
    return {
        "verdict": calibration.verdict,
        "findings": sorted(f"{f.severity} {f.code} {' '.join(f.about)}".strip() for f in calibration.findings),
        "transforms": {name: _numbers(estimate) for name, estimate in sorted(calibration.transforms.items())},
    }


def _numbers(estimate: PoseEstimate) -> list[float]:
    """Matrix by rows, (12,), and the upper triangle of the covariance, (21,)."""
    numbers = [*estimate.mean.matrix[:3].ravel(), *estimate.covariance[_UPPER]]
    return [float(f"{number:.{DIGITS}g}") for number in numbers]


def differences(before: Answer, after: Answer) -> Iterator[str]:
    """Each difference in words."""
    if before["verdict"] != after["verdict"]:
        yield f"verdict {before['verdict']} -> {after['verdict']}"
    old, new = before["findings"], after["findings"]
    yield from (f"finding gone: {each}" for each in sorted(set(old) - set(new)))
    yield from (f"finding new: {each}" for each in sorted(set(new) - set(old)))
    for name in sorted(before["transforms"].keys() | after["transforms"].keys()):
        if (name in before["transforms"]) != (name in after["transforms"]):
            yield f"{name} {'gone' if name in before['transforms'] else 'new'}"
        else:
            yield from _estimate_differences(name, *(_read(of["transforms"][name]) for of in (before, after)))


def _estimate_differences(name: str, before: tuple[SE3, np.ndarray], after: tuple[SE3, np.ndarray]) -> Iterator[str]:
    (mean, sigma), (second, second_sigma) = before, after
    step = np.abs((mean.inverse() @ second).log())
    in_sigmas = float((step / np.maximum(sigma, 1e-9)).max())
    if in_sigmas > SIGMAS:
        yield f"{name} moved by {in_sigmas:.2g} sigma, {1e3 * np.linalg.norm(step[:3]):.3g} mm"
    ratio = np.maximum(second_sigma, 1e-12) / np.maximum(sigma, 1e-12)
    if np.abs(ratio - 1).max() > SHARE:
        yield f"{name} sigma times {ratio.min():.4g} to {ratio.max():.4g}"


def _read(numbers: list[float]) -> tuple[SE3, np.ndarray]:
    """The transform, and its sigmas, (6,)."""
    rows = np.array(numbers[:12]).reshape(3, 4)
    covariance = np.zeros((6, 6))
    covariance[_UPPER] = numbers[12:]
    return SE3(rows[:, :3], rows[:, 3]), np.sqrt(np.maximum(np.diag(covariance), 0.0))
