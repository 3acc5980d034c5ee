"""`basecal demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from basecal.cli.calibrate import calibrate_folder, exit_code, show
from basecal.cli.page import print_page_path
from basecal.cli.simulate import refuse_existing, write_simulated
from basecal.cli.terminal import pasted, print_json, say

if TYPE_CHECKING:
    from basecal.geometry import SE3, PoseEstimate

_MARK = ".made-by-basecal-demo"
_BASE = "eye_base_from_hand_base"
_UNIT = {"t": (1e3, "mm"), "r": (57.29577951308232, "deg")}


def demo(folder: Path = Path("demo_cell"), /, *, json: bool = False) -> int:
    """Simulate two arms, calibrate, and compare with the truth.

    The robots' poses are off by 0.1 mm and 0.2 mrad per axis and stop; mounts
    and base are unknown. The camera's images are rendered, with blur and noise,
    and the board is found in them.

    For example:

        basecal demo
        basecal demo elsewhere --json

    Args:
        folder: Where to write the cell; one that an earlier demo made is written anew.
        json: Print calibration and true error as JSON.
    """
    from basecal.cell.files import calibration_to_dict
    from basecal.simulation.scenario import Scenario
    from basecal.simulation.testbed import simulate

    _prepare(folder)
    scenario = Scenario(samples=25, robot_noise=(1e-4, 2e-4), state_pixel_noise=False)
    made = write_simulated(folder, simulate(scenario, 0), image_seed=0)
    calibrated = calibrate_folder(folder, made.cell)
    calibration, run = calibrated.calibration, calibrated.run
    estimate = calibration.transforms.get(_BASE)
    error = true_error(estimate, made.truth[_BASE]) if estimate else None
    if json:
        answer = calibration_to_dict(calibration)
        print_json({"folder": str(folder), "calibration": answer, "true_error": {_BASE: error}})
    else:
        show(made.cell, calibration)
        print_page_path(run)
        say(_compared(estimate, error, folder) if estimate and error else "")
    return exit_code(calibration)


def _prepare(folder: Path) -> None:
    """Make the folder, or clear what an earlier demo wrote there; anything else is left alone."""
    if (folder / _MARK).exists():
        for path in ("cell.yaml", "truth.yaml", "recording/samples.jsonl"):
            (folder / path).unlink(missing_ok=True)
    refuse_existing(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARK).touch()


def true_error(estimate: PoseEstimate, truth: SE3) -> dict[str, Any]:
    """How far an estimate is from the truth, in its own axes and in its own sigmas.

    `squared_sigmas` is the error's squared length in sigmas over all six directions: 6 on average where the
    covariance is right.
    """
    import numpy as np

    error = (estimate.mean.inverse() @ truth).log()
    squared = float(error @ np.linalg.solve(estimate.covariance, error))
    return {
        "t_m": error[:3].tolist(),
        "r_rad": error[3:].tolist(),
        "error_mm": float(np.linalg.norm(error[:3])) * 1e3,
        "error_deg": float(np.degrees(np.linalg.norm(error[3:]))),
        "squared_sigmas": squared,
    }


def _compared(estimate: PoseEstimate, error: dict[str, Any], folder: Path) -> str:
    lines = ["", f"{_BASE} against the truth, along x y z of hand_base:"]
    for half, sigma in (("t", estimate.sigma_t), ("r", estimate.sigma_r)):
        scale, unit = _UNIT[half]
        off = error["t_m" if half == "t" else "r_rad"]
        lines.append(f"  true error {_three(scale * value for value in off)} {unit}")
        lines.append(f"  sigma      {_three(scale * value for value in sigma)} {unit}")
        lines.append(f"  in sigmas  {_three(value / one for value, one in zip(off, sigma, strict=True))}")
    lines += [
        f"  all six together: {error['squared_sigmas']:.1f} squared sigmas; 6 is the mean, 16.8 is passed once in 100",
        "",
        f"next: look into {folder / 'cell.yaml'}; basecal report {pasted(folder)}; "
        "for your own robots: basecal new mycell",
    ]
    return "\n".join(lines)


def _three(values: Any) -> str:
    return " ".join(f"{value:10.4f}" for value in values)
