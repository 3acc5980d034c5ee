"""Export of a calibration as the text of another program's file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from basecal.cell import Calibration, Cell
from basecal.errors import FrameNotFound, InputError, check_type
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import both_directions, chosen_transforms
from basecal.exchange.exports.exporter import ExportRequest, check_exportable, provenance


def export(
    calibration: Calibration,
    kind: str,
    transform: str | None = None,
    *,
    robot: str | None = None,
    camera: str | None = None,
    urdf: Sequence[str | Path] = (),
    joint: str | None = None,
    cell: Cell | None = None,
    folder: str | Path | None = None,
    run: str | None = None,
) -> str:
    """Export a calibration as the text of another program's file.

    Args:
        calibration: The calibration.
        kind: Export format, one of `basecal.export_kinds()`.
        transform: Name of a transform in either direction; all requested transforms if None.
        robot: Name of the robot, for formats of a robot.
        camera: Name of the camera, for formats of a camera.
        urdf: URDFs to modify, for formats that use them.
        joint: Name of the URDF joint whose origin is replaced.
        cell: The calibrated cell; it names frames, and some formats need it.
        folder: Folder of the cell.
        run: Name of the calibration's run, for comments.

    Raises:
        FrameNotFound: if the kind, transform, robot or camera does not exist.
        RefusedCalibration: if the calibration is refused.
        InputError: if the request cannot be exported, the kind does not support it, or an argument has the wrong type.
    """
    check_type("calibration", calibration, Calibration)
    if isinstance(urdf, str | Path):
        raise InputError(f"urdf is {str(urdf)!r}, expected a list of paths")
    for name, text in {"kind": kind, "transform": transform or "", "joint": joint or ""}.items():
        check_type(name, text, str)
    if kind not in EXPORTERS:
        raise FrameNotFound(kind, list(EXPORTERS))
    check_exportable(calibration)
    exporter = EXPORTERS[kind]
    given = {"transform": transform, "robot": robot, "camera": camera, "urdf": urdf, "joint": joint}
    for option, value in given.items():
        if value and option not in exporter.options:
            raise InputError(f"{kind} takes a {' or a '.join(exporter.options)}, not a {option}")
    has_transforms = "transform" in exporter.options and robot is None and camera is None
    transforms = chosen_transforms(calibration, cell, transform) if has_transforms else ()
    remarks = provenance(calibration, run)
    urdfs, cell_folder = tuple(map(Path, urdf)), None if folder is None else Path(folder)
    return exporter.text(
        ExportRequest(transforms, remarks, calibration, cell, cell_folder, robot, camera, urdfs, joint)
    )


def pasteable(calibration: Calibration, cell: Cell | None = None, run: str | None = None) -> dict[str, dict[str, str]]:
    """Texts to paste by transform, in both directions, and by kind; empty for a refused calibration.

    Raises:
        InputError: if the argument is not a calibration.
    """
    check_type("calibration", calibration, Calibration)
    if calibration.verdict == "refused":
        return {}
    remarks = provenance(calibration, run)
    requests = (
        (transform.name, ExportRequest((transform,), remarks, calibration, cell))
        for transform in both_directions(calibration, cell)
    )
    exporters = {kind: exporter for kind, exporter in EXPORTERS.items() if exporter.is_pasted}
    return {name: {kind: each.text(request) for kind, each in exporters.items()} for name, request in requests}
