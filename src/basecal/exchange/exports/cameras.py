"""Choice of the camera for an export, and of its lens."""

from __future__ import annotations

from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.exporter import ExportRequest
from basecal.geometry import Camera


def choose_camera(request: ExportRequest) -> str:
    """Name of the requested camera, or of the only camera.

    Raises:
        InputError: if no camera is requested and there is not exactly one.
    """
    if request.camera is not None:
        return request.camera
    names = _names(request)
    if len(names) != 1:
        raise InputError(f"choose a lens with --camera: {', '.join(names) or 'no lens is known'}")
    return names[0]


def exported_camera(request: ExportRequest, name: str) -> Camera:
    """Lens of a camera: the estimated lens, or else the fixed lens of the cell.

    Raises:
        FrameNotFound: if the camera does not exist.
        InputError: if the lens is unknown.
    """
    if name in request.calibration.cameras:
        return request.calibration.cameras[name][0]
    stated = {} if request.cell is None else request.cell.cameras
    if name not in stated:
        raise FrameNotFound(name, _names(request))
    intrinsics = stated[name].intrinsics
    if intrinsics is None or intrinsics.status != "fixed" or intrinsics.camera is None:
        raise InputError(f"the lens of {name!r} is not known: it was neither estimated nor is it fixed in cell.yaml")
    camera = intrinsics.camera
    return Camera(camera.model, camera.parameters, camera.size_px or stated[name].size_px)


def _names(request: ExportRequest) -> list[str]:
    stated = {} if request.cell is None else request.cell.cameras
    return list(dict.fromkeys([*request.calibration.cameras, *stated]))
