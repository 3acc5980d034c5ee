"""Export of a URDF with an estimated transform as the origin of a fixed joint."""

from __future__ import annotations

from basecal.bounded_file import read_bounded
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform
from basecal.exchange.urdf import patched_urdf
from basecal.kinematics.urdf import LARGEST_BYTES


def export_text(request: ExportRequest) -> str:
    """Set the transform in the given URDF; its links have the names of `frames` in the cell, or the cell's names.

    Raises:
        InputError: if there is not exactly one URDF and one transform, a link does not exist, or the joint is missing
            or ambiguous.
        DatasetError: if the URDF cannot be used.
    """
    if len(request.urdfs) != 1:
        raise InputError(f"expected one --urdf FILE, {len(request.urdfs)} were given")
    if len(request.transforms) != 1:
        names = ", ".join(transform.name for transform in request.transforms)
        raise InputError(f"an origin is one transform: choose one with --transform: {names}")
    (transform,), (path,) = request.transforms, request.urdfs
    remarks = comments([*request.remarks, describe_transform(transform, "m")], "")
    text, mean = read_bounded(path, LARGEST_BYTES), transform.estimate.mean
    try:
        return patched_urdf(
            text, transform.parent, transform.child, mean, joint=request.joint, remarks=remarks, path=str(path)
        )
    except FrameNotFound as error:
        hint = "; links are named by `frames: {base: ..., flange: ...}` of robots in cell.yaml"
        raise InputError(f"{path}: {error}{hint}") from None


EXPORTER = Exporter(
    "with --urdf FILE: that URDF with the estimated transform as the origin of a fixed joint",
    export_text,
    options=("transform", "urdf", "joint"),
)
