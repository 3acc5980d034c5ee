"""Wrong stated numbers: whether an answer is good beyond its sigmas. Right ones: whether a warning names them.

One arm and two arms see boards in 18 to 30 views, with no noise stated. Wrong lenses: the principal point is off by 1
to 25 px, the focal lengths by 0.5 to 2 %, or the distortion is left out. Coverage: every parameter of the lens, the
board's size, or mounts stated as `fixed` have normal errors of 0.3, 1 and 3 times a usual one. An answer is wrong if an
estimated transform is beyond four of its sigmas.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell
from basecal.cell.cell import Status
from basecal.effects import target_size
from basecal.estimation.problem.stated_lens import usual_sigmas
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import run_cells, table

FAR_SIGMAS = 4.0
LAYOUTS = "dual", "eye_in_hand", "eye_to_hand"
MOUNT_SIGMA = np.repeat([5e-4, 2e-3], 3)  # of a mount by CAD [m, rad]: assumed
ACCUSES = {"intrinsics", "length-scale", "board-size", "fixed-contradicted"}
HEAD = (
    "stated number",
    "cells",
    "good",
    "good, beyond 4 sigma",
    "accused",
    "95 % ellipsoids hold",
    "median sigma [mm]",
)
LensChange = Callable[[Camera, np.random.Generator], Camera]
CellChange = Callable[[Cell, np.random.Generator], Cell]


def _shift_centre(camera: Camera, rng: np.random.Generator) -> Camera:
    angle, size = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(1), np.log(25)))
    return _shift_parameters(camera, np.array([0, 0, size * np.cos(angle), size * np.sin(angle)]))


def _scale_focal_lengths(camera: Camera, rng: np.random.Generator) -> Camera:
    share = rng.choice([-1, 1]) * rng.uniform(0.005, 0.02)
    return _shift_parameters(camera, np.append(share * camera.parameters[:2], [0, 0]))


def _remove_distortion(camera: Camera, rng: np.random.Generator) -> Camera:
    return camera.with_parameters(np.append(camera.parameters[:4], np.zeros_like(camera.distortion)))


def _keep_lens(camera: Camera, rng: np.random.Generator) -> Camera:
    return camera


def _with_parameter_errors(factor: float) -> LensChange:
    def add_errors(camera: Camera, rng: np.random.Generator) -> Camera:
        """Every parameter with a normal error."""
        sigma = factor * usual_sigmas(camera)
        return camera.with_parameters(camera.parameters + sigma * rng.standard_normal(len(sigma)))

    return add_errors


def _shift_parameters(camera: Camera, shift: np.ndarray) -> Camera:
    return camera.with_parameters(camera.parameters + np.append(shift, np.zeros_like(camera.distortion)))


def _with_lenses(change: LensChange) -> CellChange:
    def replace_lenses(cell: Cell, rng: np.random.Generator) -> Cell:
        """The cell with every lens changed, and none exact."""
        cameras = {}
        for name, camera in cell.cameras.items():
            lens = camera.intrinsics
            assert lens is not None
            assert lens.camera is not None
            changed = replace(lens, camera=change(lens.camera, rng), exact=False)
            cameras[name] = replace(camera, intrinsics=changed)
        return replace(cell, cameras=cameras)

    return replace_lenses


def _with_target_sizes(factor: float) -> CellChange:
    def rescale_targets(cell: Cell, rng: np.random.Generator) -> Cell:
        """The cell with every target larger or smaller."""
        targets = {}
        for name, entry in cell.targets.items():
            assert entry.target is not None
            share = 1 + factor * target_size.EXPECTED.sigma * rng.standard_normal()
            targets[name] = replace(entry, target=replace(entry.target, points=entry.target.points * share))
        return replace(cell, targets=targets)

    return rescale_targets


def _with_fixed_errors(factor: float) -> CellChange:
    def move_transforms(cell: Cell, rng: np.random.Generator) -> Cell:
        """The cell with errors on every fixed transform."""
        for name, unknown in cell.transforms.items():
            if unknown.status == "fixed":
                assert unknown.mean is not None
                mean = unknown.mean @ SE3.exp(factor * MOUNT_SIGMA * rng.standard_normal(6))
                cell = cell.with_transform(name, replace(unknown, mean=mean))
        return cell

    return move_transforms


@dataclass(frozen=True)
class Kind:
    """A change of the stated cell, the number of cells, and the status of the camera mount."""

    change: CellChange
    cells: int
    mount: Status = "free"


KINDS = {
    "principal point off": Kind(_with_lenses(_shift_centre), 20),
    "focal length off": Kind(_with_lenses(_scale_focal_lengths), 20),
    "distortion left out": Kind(_with_lenses(_remove_distortion), 20),
    "right": Kind(_with_lenses(_keep_lens), 200),
    **{f"lens, {k} times the default": Kind(_with_lenses(_with_parameter_errors(k)), 60) for k in (0.3, 1.0, 3.0)},
    **{f"board's size, {k} times the default": Kind(_with_target_sizes(k), 60) for k in (0.3, 1.0, 3.0)},
    **{f"fixed mount, {k} times 0.5 mm and 2 mrad": Kind(_with_fixed_errors(k), 60, "fixed") for k in (0.3, 1.0, 3.0)},
}


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """Outcomes of one seed for each kind that has so many cells."""
    for name, kind in KINDS.items():
        if seed < kind.cells:
            yield {"number": name, **_outcome(kind, seed)}


def _outcome(kind: Kind, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 77])
    scenario = Scenario(
        samples=int(rng.integers(18, 31)),
        layout=LAYOUTS[seed % 3],
        camera_mount=kind.mount,
        robot_noise=(1e-4, 2e-4),
        state_robot_noise=False,
        state_pixel_noise=False,
    )
    simulated = simulate(scenario, 3000 + seed)
    cell = kind.change(simulated.cell, rng)
    calibration = calibrate(cell, simulated.recording)
    worst, held, sigma = _errors(simulated, cell, calibration)
    codes = [f.code for f in calibration.findings if f.severity != "info"]
    return {"verdict": calibration.verdict, "codes": codes, "worst_sigmas": worst, "held": held, "sigma_mm": sigma}


def _errors(simulated: SimulatedCell, cell: Cell, calibration: Calibration) -> tuple[float, list[bool], float | None]:
    """The largest error in sigmas, whether each 95 % ellipsoid holds the truth, the first transform's sigma [mm]."""
    worst, held = 0.0, []
    estimated = {n: e for n, e in calibration.transforms.items() if cell.transforms[n].status != "fixed"}
    for name, estimate in estimated.items():
        error = (estimate.mean.inverse() @ simulated.truth[name]).log()
        worst = max(worst, float(np.abs(error / np.sqrt(np.diag(estimate.covariance))).max()))
        held.append(bool(error @ np.linalg.solve(estimate.covariance, error) < chi2.ppf(0.95, 6)))
    first = next(iter(estimated.values()), None)
    return worst, held, None if first is None else 1e3 * float(np.sqrt(np.trace(first.covariance[:3, :3])))


def rows(results: list[dict[str, Any]]) -> list[list[str]]:
    """A line for each kind of stated number."""
    return [_row(name, [each for each in results if each["number"] == name]) for name in KINDS]


def _row(name: str, results: list[dict[str, Any]]) -> list[str]:
    good = [each for each in results if each["verdict"] == "good"]
    held = [each for one in results for each in one["held"]]
    sigmas = [each["sigma_mm"] for each in results if each["sigma_mm"] is not None]
    return [
        name,
        str(len(results)),
        str(len(good)),
        str(sum(each["worst_sigmas"] > FAR_SIGMAS for each in good)),
        str(sum(bool(ACCUSES & set(each["codes"])) for each in results)),
        f"{100 * np.mean(held):.1f} %" if held else "-",
        f"{np.median(sigmas):.3f}" if sigmas else "-",
    ]


def format_table(results: list[dict[str, Any]]) -> str:
    """The table of all kinds."""
    return table(HEAD, rows(results))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = """\
Boards in 18 to 30 views of one arm and of two arms, with no noise stated. The stated numbers are:

- A lens stated as `fixed`: its principal point, focal lengths or distortion are wrong, or all of it is right.
- The same lens, with normal errors of so many default sigmas on every parameter.
- The size of the board, with a normal error of so many default sigmas.
- A camera mount stated as `fixed`, with normal errors of so many times 0.5 mm and 2 mrad.

`good, beyond 4 sigma` counts good answers with an estimated transform beyond 4 sigma. `accused` counts cells in which a
warning names a stated number."""
    return f"{about}\n\n{format_table(result['rows'])}"


if __name__ == "__main__":
    run_cells("stated_numbers", sys.argv[1:], 200, measure, format_table)
