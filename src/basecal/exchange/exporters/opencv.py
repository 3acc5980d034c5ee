"""Export of transforms, or of a camera's lens, as OpenCV's FileStorage (YAML)."""

from __future__ import annotations

from basecal.errors import InputError, list_names
from basecal.exchange.exports.cameras import exported_camera
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform
from basecal.geometry import Array
from basecal.geometry.lenses import fisheye, pinhole

_MODELS = (pinhole.MODEL, fisheye.MODEL)


def export_text(request: ExportRequest) -> str:
    """Format a map per transform: `R`, `t` [m], `rvec`, `T` (4x4), `covariance`; or a lens as used by `calib3d`.

    Raises:
        InputError: if the lens is of a model that OpenCV lacks.

    Source: docs.opencv.org, "File Input and Output using XML and YAML files".
    """
    lines = ["%YAML:1.0", "---", *comments(request.remarks, "#")]
    if request.camera is not None:
        camera = exported_camera(request, request.camera)
        if camera.model not in _MODELS:
            raise InputError(f"OpenCV has no {camera.model} lens; it has {list_names(_MODELS)}")
        if camera.size_px is not None:
            lines += [f"image_width: {camera.size_px[0]}", f"image_height: {camera.size_px[1]}"]
        lines += _matrix("camera_matrix", camera.matrix)
        lines += _matrix("distortion_coefficients", camera.distortion[None])
        lines += ["fisheye_model: 1"] if camera.model == fisheye.MODEL else []
    for transform in request.transforms:
        mean = transform.estimate.mean
        matrices = {
            "R": mean.rotation,
            "t": mean.translation[:, None],
            "rvec": mean.rotvec[:, None],
            "T": mean.matrix,
            "covariance": transform.estimate.covariance,
        }
        lines += [*comments([describe_transform(transform, "m")], "#"), f"{transform.name}:"]
        lines += [f"   {line}" for name, values in matrices.items() for line in _matrix(name, values)]
    return "\n".join(lines) + "\n"


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = values.shape
    data = ", ".join(repr(float(value) + 0.0) for value in values.ravel())
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {data} ]",
    ]


EXPORTER = Exporter(
    "FileStorage in YAML of transforms, or with --camera of its lens",
    export_text,
    options=("transform", "camera"),
    is_pasted=True,
)
