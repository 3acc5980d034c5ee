"""`basecal demo`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from basecal.cli.calibrate import calibrate_folder, exit_code, print_calibration
from basecal.cli.option_types import OpensPage
from basecal.cli.page import FILE, show_page
from basecal.cli.simulate import refuse_existing
from basecal.cli.simulated_process import simulated_process
from basecal.cli.terminal import print_json, quote_path, say

if TYPE_CHECKING:
    from basecal.geometry import SE3, PoseEstimate

_MARKER_FILE = ".made-by-basecal-demo"
_BASE = "eye_base_from_hand_base"
_SAMPLES = {"poses": 25, "shifts": 35}  # by pattern; shifts are five stations of seven
_SPEED_DEG_S = 120.0  # speed of simulated arms, without a person near them
_RECORDING_FILES = ("samples.jsonl", "plan.jsonl", "plan_options.json", "given_up.jsonl")
_FILES = ("cell.yaml", "truth.yaml", *(f"recording/{name}" for name in _RECORDING_FILES))
_FOLDERS = ("recording/images", "derived", "runs")
_CHI_SQUARE_LIMIT = 16.8  # 99 % limit of chi-square with six degrees of freedom
_UNITS = {"t": (1e3, "mm"), "r": (57.29577951308232, "deg")}


def demo(
    folder: Path = Path("demo_cell"),
    /,
    *,
    led: bool = False,
    opens_page: OpensPage = False,
    json: bool = False,
) -> int:
    """Run two simulated arms, capture, calibrate, and compare with the truth.

    Two UR5e, a camera and a board run as a separate process. The arms move to 25
    poses, images are taken at rest, and the board is detected. Mounts and base
    are unknown. With --led the demo follows the paper. At several stations an LED
    is shifted along its axes in front of a fixed camera, with images of the LED
    on and off. The closed form and maximum likelihood are both compared with the
    truth.

    For example:

        basecal demo
        basecal demo --led
        basecal demo elsewhere --json

    Args:
        folder: Folder of the new cell; the cell of an earlier demo is overwritten.
        led: Shift an LED as in the paper, instead of moving a board.
        opens_page: Show the page in a browser.
        json: Print calibration and true error as JSON.
    """
    from basecal.cell.files import calibration_to_dict, read_cell, read_truth
    from basecal.estimation.settings import Settings

    _prepare(folder)
    with simulated_process(folder, "led" if led else "charuco"):
        _capture(folder, "shifts" if led else "poses", quiet=json)
    cell, truth = read_cell(folder), read_truth(folder)[_BASE]
    closed_form = None
    if led:
        closed_form = calibrate_folder(folder, cell, Settings(method="axis-shift")).calibration.transforms.get(_BASE)
    result = calibrate_folder(folder, cell, Settings())
    estimate = result.calibration.transforms.get(_BASE)
    error = true_error(estimate, truth) if estimate else None
    if json:
        calibration_data = calibration_to_dict(result.calibration)
        others = {"closed_form_error": true_error(closed_form, truth)} if closed_form else {}
        print_json({"folder": str(folder), "calibration": calibration_data, "true_error": {_BASE: error}, **others})
    else:
        print_calibration(cell, result.calibration)
        show_page(result.run / FILE, opens_page)
        if closed_form:
            say(_comparison(closed_form, true_error(closed_form, truth), "the paper's closed form"))
        say(_comparison(estimate, error, "maximum likelihood" if led else _BASE) if estimate and error else "")
        own = "for your own robots: basecal new mycell"
        say(f"\nnext: look into {folder / 'cell.yaml'}; basecal report {quote_path(folder)}; {own}")
    return exit_code(result.calibration)


def _capture(folder: Path, pattern: str, quiet: bool) -> None:
    from basecal.cli.capture import captured_steps
    from basecal.cli.capture_view import say_step

    for step in captured_steps(folder, pattern, _SAMPLES[pattern], _SPEED_DEG_S):
        if not quiet:
            say_step(step)


def _prepare(folder: Path) -> None:
    """Make the folder, or delete the files of an earlier demo in it; other files are kept.

    Raises:
        DatasetError: if a link leads out of the folder.
        InputError: if the folder has a cell that is not from a demo.
    """
    from basecal.cell.format.paths import own_file

    for name in (*_FILES, *_FOLDERS):
        own_file(folder, name)
    if (folder / _MARKER_FILE).exists():
        for name in _FILES:
            (folder / name).unlink(missing_ok=True)
    refuse_existing(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARKER_FILE).touch()


def true_error(estimate: PoseEstimate, truth: SE3) -> dict[str, Any]:
    """Error of an estimate in its own axes, and its chi-square.

    `squared_sigmas` is the squared Mahalanobis length of the error over all six degrees of freedom: 6 on average if the
    covariance is correct.
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


def _comparison(estimate: PoseEstimate, error: dict[str, Any], subject: str) -> str:
    from basecal.reporting.statement.verdict import shown_decimals

    lines = ["", f"{subject} against the truth, along x y z of hand_base:"]
    for half, sigma in (("t", estimate.sigma_t), ("r", estimate.sigma_r)):
        scale, unit = _UNITS[half]
        error_vector = error["t_m" if half == "t" else "r_rad"]
        decimals = shown_decimals(scale * sigma)
        lines.append(f"  true error {_three_columns((scale * value for value in error_vector), decimals)} {unit}")
        lines.append(f"  sigma      {_three_columns(scale * sigma, decimals)} {unit}")
        ratios = (value / one_sigma for value, one_sigma in zip(error_vector, sigma, strict=True))
        lines.append(f"  in sigmas  {_three_columns(ratios, 2)}")
    squared = error["squared_sigmas"]
    outcome = "consistent" if squared < _CHI_SQUARE_LIMIT else "inconsistent"
    lines.append(f"  chi-square {squared:.1f} with 6 degrees of freedom (99 % limit {_CHI_SQUARE_LIMIT:g}): {outcome}")
    return "\n".join(lines)


def _three_columns(values: Iterable[float], decimals: int) -> str:
    return " ".join(f"{value:10.{decimals}f}" for value in values)
