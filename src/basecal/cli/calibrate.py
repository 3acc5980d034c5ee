"""`basecal calibrate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from basecal.cli.detect import detected_recording
from basecal.cli.next_step import fill_in_commands, next_command, next_step
from basecal.cli.option_types import Box, OpensPage, Point, task_points
from basecal.cli.page import FILE, StoredRun, add_stored_scene, show_page, write_page
from basecal.cli.terminal import print_json, print_stages, progress, say, say_next, say_verdict
from basecal.errors import UsageError, printable
from basecal.fields.typed_length import length_m

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell
    from basecal.estimation.settings import Settings


_EXIT_CODES = {"REFUSED": 4, "FAIL": 5, "DOUBTFUL": 1}


def calibrate(
    cell: Path,
    /,
    *,
    method: Literal["maximum-likelihood", "axis-shift"] = "maximum-likelihood",
    start: Literal["closed", "thorough", "guess", "axis-shift"] = "closed",
    scene: bool | Literal["also"] = False,
    task_point: Point | None = None,
    task_box: Box | None = None,
    station_choice: Literal["nearest", "weighted"] = "nearest",
    certify: bool = False,
    against: Literal["opencv"] | None = None,
    robot_noise: Literal["estimated", "stated"] = "estimated",
    tolerance: str | None = None,
    opens_page: OpensPage = False,
    json: bool = False,
    verbose: bool = False,
) -> int:
    """Estimate the requested transforms, with their covariance.

    Reads CELL/cell.yaml and CELL/recording/samples.jsonl. Writes the result
    and its report, as text and as a page, to CELL/runs. Prints the verdict, the
    requested transforms with their sigma, the cross-validation error and what
    to do; with --verbose the whole report. Exit code: 0 if the result is good or
    the tolerance met, 1 if doubtful, 4 if refused, 5 if the tolerance is missed.

    For example:

        basecal calibrate mycell
        basecal calibrate mycell --json > answer.json
        basecal calibrate mycell --tolerance 0.5mm
        basecal calibrate mycell --task-point 0.8 0.1 0.3
        basecal calibrate mycell --task-box 0.6 -0.2 0.1 1.0 0.2 0.5
        basecal calibrate mycell --certify
        basecal calibrate mycell --against opencv
        basecal calibrate mycell --scene
        basecal calibrate mycell --scene also
        basecal calibrate mycell --open
        basecal calibrate mycell --verbose
        basecal calibrate mycell --method axis-shift --task-point 0.8 0.1 0.3

    Args:
        cell: Folder of the cell.
        method: axis-shift is the closed form for an LED shifted in front of a fixed camera.
        start: Initial values of the solver: a closed form, a search, the cell's guesses, or the axis-shift method.
        scene: Calibrate from the static scene that cameras on the robots see, without a target. With `--scene also` the
            scene is used in addition to targets, if held-out views are then predicted better.
        task_point: Task position x y z [m] in the reference robot's base. The error there is reported by source, and
            the axis-shift method fits best there.
        task_box: Task volume, by two opposite corners, instead of a point. The error is reported for its middle. The
            box is also calibrated separately, with a report whether that predicts held-out samples in it better.
        station_choice: With a task point, use the nearest station, or all stations weighted by distance.
        certify: Prove that no other solution fits better, or report why that cannot be proven.
        against: Compare the prediction of held-out views with OpenCV's methods.
        robot_noise: Estimate unstated noise of robots, or assume robots without stated noise exact.
        tolerance: Length with its unit, such as 0.5mm, below which 95 % of position errors must be expected.
        opens_page: Show the page in a browser.
        json: Print calibration.json instead of text, with the verdict on the tolerance.
        verbose: Print the whole report, and on stderr the run time of each stage.
    """
    from basecal.cell.files import calibration_to_dict, read_cell
    from basecal.estimation.settings import Settings

    _refuse_unused_options(_method_in_use(method, scene), start, task_point, task_box, station_choice)
    described = read_cell(cell)
    settings = Settings(
        method="scene" if scene is True else method,
        start=start,
        task_point=task_point if task_box is None else task_points(task_point, task_box)[0],
        task_box=task_box,
        station_choice=station_choice,
        certify=certify,
        against=against,
        robot_noise=robot_noise,
        joins_scene=scene == "also",
    )
    result = calibrate_folder(cell, described, settings, verbose, None if tolerance is None else length_m(tolerance))
    if json:
        print_json(calibration_to_dict(fill_in_commands(result.calibration, cell)))
    else:
        print_result(result, described, cell, verbose, opens_page)
    return exit_code(result.calibration)


def print_result(
    result: CalibratedFolder, cell: Cell, folder: Path, verbose: bool = False, opens_page: bool = False
) -> None:
    """Print a calibration, the path of its page, and the next step."""
    from basecal.cell.files import read_recording

    print_calibration(cell, fill_in_commands(result.calibration, folder), verbose)
    show_page(result.run / FILE, opens_page)
    is_refused = result.calibration.verdict == "refused"
    by_scene = result.calibration.settings.get("method") == "scene"
    next_import = next_step(cell, read_recording(folder, cell), folder, by_scene) if is_refused else None
    if next_import:
        say(next_import)
    else:
        say_next(next_command(cell, result.calibration, folder))


@dataclass(frozen=True, eq=False)
class CalibratedFolder:
    """Result of `calibrate_folder`: the calibration, and the folder of its run."""

    calibration: Calibration
    run: Path


def _method_in_use(method: str, scene: bool | str) -> str:
    """Name of the method in use, `scene` for a calibration from the scene alone.

    Raises:
        UsageError: if the method cannot use a scene.
    """
    if scene == "also" and method == "axis-shift":
        raise UsageError("--scene also has no effect on --method axis-shift: leave one of them out")
    return "scene" if scene is True else method


def _refuse_unused_options(method: str, start: str, task_point: object, task_box: object, station_choice: str) -> None:
    """Refuse options that have no effect on the method.

    Raises:
        UsageError: if there is such an option; the message names it and its method.
    """
    if method == "scene" and start != "closed":
        raise UsageError(f"--start {start} has no effect on --scene, which needs no initial guess: leave it out")
    if method != "axis-shift" and station_choice != "nearest":
        raise UsageError(
            f"--station-choice has no effect on --method {method}: give --method axis-shift, or leave it out"
        )
    if method == "axis-shift" and task_box is not None:
        raise UsageError(
            "--task-box has no effect on --method axis-shift, whose stations are its parts: give --task-point x y z"
        )
    if method == "axis-shift" and task_point is None and station_choice != "nearest":
        raise UsageError("--station-choice needs a point to choose stations for: give --task-point x y z")
    if method == "axis-shift" and start != "closed":
        raise UsageError(f"--start {start} is ignored: --method axis-shift needs no initial guess: leave it out")


def calibrate_folder(
    folder: Path,
    cell: Cell,
    settings: Settings | None = None,
    verbose: bool = False,
    tolerance_m: float | None = None,
) -> CalibratedFolder:
    """Calibrate the recording of a cell's folder and write the run."""
    from dataclasses import replace

    from basecal.accuracy.calibrate import calibrate as calibrated
    from basecal.accuracy.fit_details import fit_details
    from basecal.accuracy.task.expected_error import check_tolerance
    from basecal.cell.files import calibration_from_dict, calibration_to_dict, input_hashes, write_calibration
    from basecal.cell.format.writing import write_atomically
    from basecal.cell.results.versions import used_versions
    from basecal.estimation.settings import Settings
    from basecal.estimation.stages import Stages
    from basecal.estimation.streams.streams import synchronous_recording
    from basecal.reporting.text import text_report

    inputs = input_hashes(folder, cell)
    recording = detected_recording(folder, cell)
    with progress("calibrating") as notify:
        stages = Stages(notify)
        calibration = calibrated(cell, recording, replace(settings or Settings(), stages=stages))
        used = calibration.settings if tolerance_m is None else {**calibration.settings, "tolerance_m": tolerance_m}
        calibration = replace(calibration, settings=used, inputs=inputs, versions=used_versions())
        stored = calibration_from_dict(calibration_to_dict(calibration))  # with the same digits as `report` reads
        with stages.stage("report"):
            recording = synchronous_recording(cell, recording, stored)
            shown = add_stored_scene(cell, recording, stored, calibration.scene)
            details = fit_details(*shown, stored)
            calibration = replace(calibration, tolerance=check_tolerance(cell, stored, details.errors))
            stored = replace(stored, tolerance=calibration.tolerance)
            run = write_calibration(calibration, folder).parent
            write_atomically(run / "report.txt", printable(text_report(cell, calibration)) + "\n", base_folder=folder)
            write_page(cell, stored, StoredRun(run, recording, shown, details))
    if verbose:
        print_stages(stages.seconds)
    return CalibratedFolder(calibration, run)


def recalibrate_folder(folder: Path, cell: Cell, calibration: Calibration) -> CalibratedFolder:
    """Calibrate a cell's folder with the settings and the tolerance of an earlier calibration."""
    from basecal.estimation.settings import Settings

    settings = calibration.settings
    return calibrate_folder(folder, cell, Settings.from_dict(settings), tolerance_m=settings.get("tolerance_m"))


def print_calibration(cell: Cell, calibration: Calibration, verbose: bool = False) -> None:
    """Print the summary of a calibration, or the whole report."""
    from basecal.reporting.statement.verdict import COLOURS, verdict_word
    from basecal.reporting.summary import summary
    from basecal.reporting.text import text_report

    say_verdict((text_report if verbose else summary)(cell, calibration), COLOURS[verdict_word(calibration)])


def exit_code(calibration: Calibration) -> int:
    """Exit code of a calibration: 4 if refused, 5 if a tolerance is missed, 1 if doubtful, else 0."""
    from basecal.reporting.statement.verdict import verdict_word

    return _EXIT_CODES.get(verdict_word(calibration), 0)
