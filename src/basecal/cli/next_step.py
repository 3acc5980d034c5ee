"""The next command for a cell: import of missing parts before a calibration, and steps after it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.terminal import quote_path
from basecal.errors import list_names

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell, CellCamera, CellTarget, Finding, Recording

_JOINT_IMPORTERS = ("joints", "lerobot")  # importers of recorded joints


def next_command(cell: Cell, calibration: Calibration, folder: Path) -> str:
    """The next command after a calibration of a cell's folder."""
    from basecal.accuracy.fixing.offers import is_fixable
    from basecal.reporting.statement.verdict import calibrate_command, missed_step, verdict_word

    quoted_folder, word = quote_path(folder), verdict_word(calibration)
    if word in ("PASS", "GOOD"):
        return f"basecal export {quoted_folder}"
    fix = f"basecal fix {quoted_folder}, or " if any(is_fixable(cell, each) for each in calibration.findings) else ""
    if word == "FAIL":
        return f"{fix}{missed_step(cell, calibration, quoted_folder)}"
    return f"{fix}follow the advice above, then {calibrate_command(cell, calibration, quoted_folder)}"


def capture_command(cell: Cell, folder: Path) -> str:
    """The command that records samples; with --freedrive for a scene."""
    return f"basecal capture {quote_path(folder)}{' --freedrive' if cell.sees_scene or not cell.targets else ''}"


def has_drivers(cell: Cell) -> bool:
    """Whether `basecal capture` can reach all robots and cameras."""
    drivers = [robot.driver for robot in cell.robots.values()] + [camera.driver for camera in cell.cameras.values()]
    return bool(drivers) and None not in drivers


def fill_in_commands(calibration: Calibration, folder: Path) -> Calibration:
    """The calibration with the cell's folder filled into the commands of its findings."""
    return replace(calibration, findings=tuple(fill_in_command(each, folder) for each in calibration.findings))


def fill_in_command(finding: Finding, folder: Path) -> Finding:
    """The finding with the cell's folder filled into its commands."""
    return replace(finding, do=tuple(each.replace(" CELL", f" {quote_path(folder)}") for each in finding.do))


def cameras_without_lens(cell: Cell, recording: Recording) -> list[str]:
    """Cameras whose images are not searched because no lens is stated."""
    lensless = [name for name, camera in cell.cameras.items() if camera.intrinsics is None]
    return [name for name in lensless if any(name in sample.images for sample in recording.samples)]


def _missing_robot(cell: Cell, recording: Recording) -> tuple[str, list[int]] | None:
    """The first robot that carries an observed camera or target but has no state, with the numbers of the samples."""
    items: dict[str, CellCamera | CellTarget] = {**cell.cameras, **cell.targets}
    missing: dict[str, list[int]] = {}
    for sample in recording.samples if len(cell.robots) > 1 else ():
        names = {name for o in sample.observations for name in (o.camera, o.target) if name in items}
        absent = {items[name].on for name in names} & cell.robots.keys() - sample.robots.keys()
        for robot in absent if sample.robots else ():
            missing.setdefault(robot, []).append(sample.sample)
    return next(iter(missing.items()), None)


def _states_command(cell: Cell, quoted_folder: str, robot: str, importer: str, is_still: bool = False) -> str:
    """The command that imports a robot's states, by the importer of the last import or from the robot's description.

    Args:
        cell: The cell.
        quoted_folder: The cell's folder, quoted for a shell.
        robot: Name of the robot.
        importer: Name of the importer of the last import.
        is_still: Whether the robot was at rest.
    """
    kind = importer if importer in _JOINT_IMPORTERS else "poses" if cell.robots[robot].urdf is None else "joints"
    model = "" if cell.robots[robot].urdf else " --urdf URDF --base-link LINK --flange-link LINK"
    options = {"poses": "--format FORMAT", "joints": model[1:], "lerobot": f"--unit UNIT{model}"}[kind]
    source = "DATASET" if kind == "lerobot" else "FILE"
    session = " --still" if is_still and kind != "lerobot" else ""
    return f"basecal import {kind} {quoted_folder} --robot {robot} {source} {options}".rstrip() + session


def next_step(cell: Cell, recording: Recording, folder: Path, by_scene: bool = False, importer: str = "") -> str | None:
    """Describe the first missing part of a cell and how to add it; None if the cell can be calibrated.

    Args:
        cell: The cell.
        recording: The recording.
        folder: The cell's folder.
        by_scene: Whether to calibrate from the static scene, which needs no target.
        importer: Name of the importer of the last import.
    """
    from basecal.exchange.images import ENDINGS

    quoted_folder = quote_path(folder)
    if not cell.cameras:
        arguments = f"{quoted_folder} DIR --camera NAME --on ROBOT [--target KIND ...]"
        return f"next, its images: basecal import images {arguments}"
    has_views = any(sample.images or sample.observations or sample.tracks for sample in recording.samples)
    stateless = [name for name in cell.robots if not any(name in sample.robots for sample in recording.samples)]
    if stateless:
        command = _states_command(cell, quoted_folder, stateless[0], importer)
        quantity = "poses" if " import poses " in command else "joints"
        return f"next, {quantity} of {list_names(stateless)}: {command}"
    if missing := _missing_robot(cell, recording):
        robot, numbers = missing
        command = _states_command(cell, quoted_folder, robot, importer, is_still=True)
        return f"next, the states of {robot} in samples {numbers[0]} to {numbers[-1]}: {command}"
    if not has_views:
        camera = next(iter(cell.cameras))
        image_folder = folder / "recording" / "images" / camera
        has_images = image_folder.is_dir() and any(path.suffix.lower() in ENDINGS for path in image_folder.iterdir())
        source = quote_path(image_folder) if has_images else "DIR"
        return f"next, its images: basecal import images {quoted_folder} {source} --camera {camera}"
    if lensless := cameras_without_lens(cell, recording):
        return f"next, the lens of {list_names(lensless)}: add `intrinsics: {{status: free}}` to it in cell.yaml"
    if not (cell.targets or cell.sees_scene or by_scene):
        scene = f"basecal calibrate {quoted_folder} --scene"
        return f"next, state in cell.yaml which target the images show (`targets:`, docs/data_format.md), or: {scene}"
    carriers = {each.on for each in cell.cameras.values()} | {each.on for each in cell.targets.values()}
    if idle := [name for name in cell.robots if name not in carriers]:
        return f"next, what {list_names(idle)} carries: import its images, or correct `on:` in cell.yaml"
    return None
