"""Transforms, or a camera's lens, as a file of OpenCV's FileStorage (YAML)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from basecal.exchange.exporters.exporter import Takes
from basecal.exchange.exports.cameras import exported_camera
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import NamedTransform, Wanted
from basecal.geometry import Array, Camera

TAKES: tuple[Takes, ...] = ("transform", "camera")
PASTED = True


def exported(wanted: Wanted) -> str:
    """A map for each transform: `R`, `t` [m], `rvec`, `T` (4x4), `covariance`; or what `calib3d` takes of a lens.

    Source: docs.opencv.org, "File Input and Output using XML and YAML files".
    """
    lines = ["%YAML:1.0", "---", *comments(wanted.remarks, "#")]
    if wanted.camera is not None:
        lines += _lens(exported_camera(wanted, wanted.camera))
    for one in wanted.transforms:
        lines += [*comments([about(one, "m")], "#"), f"{one.name}:", *(f"   {line}" for line in _maps(one))]
    return "\n".join(lines) + "\n"


def _maps(one: NamedTransform) -> Iterable[str]:
    mean = one.estimate.mean
    yield from _matrix("R", mean.rotation)
    yield from _matrix("t", mean.translation[:, None])
    yield from _matrix("rvec", mean.rotvec[:, None])
    yield from _matrix("T", mean.matrix)
    yield from _matrix("covariance", one.estimate.covariance)


def _lens(camera: Camera) -> list[str]:
    (fx, fy), (cx, cy) = camera.focal, camera.center
    size = [] if camera.size_px is None else [f"image_width: {camera.size_px[0]}", f"image_height: {camera.size_px[1]}"]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return [*size, *_matrix("camera_matrix", matrix), *_matrix("distortion_coefficients", camera.distortion[None])]


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
