"""Stated lenses that are wrong: whether an answer is GOOD beyond its sigmas; and right ones: whether they are accused.

Boards seen by one arm and by two in 18 to 30 views, no noise stated. Wrong lenses: the principal point off by 1 to
25 px, the focal lengths by 0.5 to 2 %, the distortion left out. Coverage: every parameter off by a normal error of
0.3, 1 and 3 times the default sigma. An answer is wrong if a transform is beyond four of its sigmas.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.verdict import calibrate
from basecal.cell import Calibration
from basecal.estimation.problem.stated_lens import usual_sigmas
from basecal.geometry import Camera
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import cell_by_cell, table

BEYOND = 4.0
LAYOUTS = "dual", "eye_in_hand", "eye_to_hand"
HEAD = ("lens", "cells", "good", "good, beyond 4 sigma", "accused", "95 % ellipsoids hold", "median sigma [mm]")
Off = Callable[[Camera, np.random.Generator], Camera]


def _centre(camera: Camera, rng: np.random.Generator) -> Camera:
    angle, size = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(1), np.log(25)))
    return _with(camera, np.array([0, 0, size * np.cos(angle), size * np.sin(angle)]))


def _focal(camera: Camera, rng: np.random.Generator) -> Camera:
    share = rng.choice([-1, 1]) * rng.uniform(0.005, 0.02)
    return _with(camera, np.append(share * camera.parameters[:2], [0, 0]))


def _undistorted(camera: Camera, rng: np.random.Generator) -> Camera:
    return camera.with_parameters(np.append(camera.parameters[:4], np.zeros_like(camera.distortion)))


def _right(camera: Camera, rng: np.random.Generator) -> Camera:
    return camera


def _times(factor: float) -> Off:
    def off(camera: Camera, rng: np.random.Generator) -> Camera:
        """Every parameter off by a normal error."""
        sigma = factor * usual_sigmas(camera)
        return camera.with_parameters(camera.parameters + sigma * rng.standard_normal(len(sigma)))

    return off


def _with(camera: Camera, shift: np.ndarray) -> Camera:
    return camera.with_parameters(camera.parameters + np.append(shift, np.zeros_like(camera.distortion)))


KINDS: dict[str, tuple[Off, int]] = {
    "principal point off": (_centre, 20),
    "focal length off": (_focal, 20),
    "distortion left out": (_undistorted, 20),
    "right": (_right, 200),
    "0.3 times the default": (_times(0.3), 60),
    "1 times the default": (_times(1.0), 60),
    "3 times the default": (_times(3.0), 60),
}


def measured(seed: int) -> Iterator[dict[str, Any]]:
    """One cell of each kind that has so many."""
    for name, (off, count) in KINDS.items():
        if seed < count:
            yield {"lens": name, **_outcome(off, seed)}


def _outcome(off: Off, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 77])
    scenario = Scenario(
        samples=int(rng.integers(18, 31)),
        layout=LAYOUTS[seed % 3],
        robot_noise=(1e-4, 2e-4),
        state_robot_noise=False,
        state_pixel_noise=False,
    )
    made = simulate(scenario, 3000 + seed)
    cameras = {}
    for name, camera in made.cell.cameras.items():
        lens = camera.intrinsics
        assert lens is not None
        assert lens.camera is not None
        cameras[name] = replace(camera, intrinsics=replace(lens, camera=off(lens.camera, rng), exact=False))
    found = calibrate(replace(made.cell, cameras=cameras), made.recording)
    worst, held, sigma = _errors(made, found)
    codes = [f.code for f in found.findings if f.severity != "info"]
    return {"verdict": found.verdict, "codes": codes, "worst_sigmas": worst, "held": held, "sigma_mm": sigma}


def _errors(made: SimulatedCell, found: Calibration) -> tuple[float, list[bool], float | None]:
    """The largest error in sigmas, whether each 95 % ellipsoid holds the truth, the first transform's sigma [mm]."""
    worst, held = 0.0, []
    for name, estimate in found.transforms.items():
        error = (estimate.mean.inverse() @ made.truth[name]).log()
        worst = max(worst, float(np.abs(error / np.sqrt(np.diag(estimate.covariance))).max()))
        held.append(bool(error @ np.linalg.solve(estimate.covariance, error) < chi2.ppf(0.95, 6)))
    first = next(iter(found.transforms.values()), None)
    return worst, held, None if first is None else 1e3 * float(np.sqrt(np.trace(first.covariance[:3, :3])))


def rows(found: list[dict[str, Any]]) -> list[list[str]]:
    """A line for each kind of lens."""
    return [_row(name, [each for each in found if each["lens"] == name]) for name in KINDS]


def _row(name: str, of: list[dict[str, Any]]) -> list[str]:
    good = [each for each in of if each["verdict"] == "good"]
    held = [each for one in of for each in one["held"]]
    sigmas = [each["sigma_mm"] for each in of if each["sigma_mm"] is not None]
    return [
        name,
        str(len(of)),
        str(len(good)),
        str(sum(each["worst_sigmas"] > BEYOND for each in good)),
        str(sum("intrinsics" in each["codes"] for each in of)),
        f"{100 * np.mean(held):.1f} %" if held else "-",
        f"{np.median(sigmas):.3f}" if sigmas else "-",
    ]


def shown(found: list[dict[str, Any]]) -> str:
    """As a table."""
    return table(HEAD, rows(found))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = """\
Boards in 18 to 30 views of one arm and of two, no noise stated, the lens stated as `fixed`: with its principal point,
focal lengths or distortion wrong, right, and with every parameter off by a normal error of so many default sigmas.
`good, beyond 4 sigma`: an exported transform is, though the verdict is good."""
    return f"{about}\n\n{shown(result['rows'])}"


if __name__ == "__main__":
    cell_by_cell("stated_lens", sys.argv[1:], 200, measured, shown)
