"""Import of a lens written with OpenCV: FileStorage (YAML, XML, JSON) or a NumPy archive, with the usual names.

The pixels are OpenCV's: the centre of the top-left pixel is (0, 0). Four terms are k1 k2 p1 p2 or the fisheye's; only
the file's `fisheye_model`, or the user, can decide which.
Source: OpenCV's tutorials on camera calibration, whose sample writes camera_matrix and distortion_coefficients and
whose Python page writes mtx and dist; stereo_calib's M1, D1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from basecal.errors import DatasetError, InputError, count_text, list_names
from basecal.exchange.fields import Field
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import (
    LensStatus,
    StatedLens,
    lens_of_file,
    make_camera,
    matrix_parameters,
    opencv_terms,
)
from basecal.exchange.lens_files.file_storage import read_file_storage
from basecal.exchange.npz import read_arrays
from basecal.geometry import Camera
from basecal.geometry.lenses.registry import term_counts

# Without underscores, in lower case.
_MATRIX = ("cameramatrix", "cameramat", "intrinsicmatrix", "intrinsics", "intrinsic", "mtx", "k", "m", "matrix")
_TERMS = ("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distcoeff", "distortion", "dist", "d", "coeffs")
_SIZE = ("imagesize", "imgsize", "size", "resolution", "framesize")
_WIDTHS, _HEIGHTS = ("imagewidth", "width", "w"), ("imageheight", "height", "h")
_FOCAL_AND_CENTRE = ("fx", "fy", "cx", "cy")
_TERM_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # in OpenCV's order
_FISHEYE = ("fisheyemodel", "fisheye", "isfisheye")
_MATRIX_SIZE = 9


def read_opencv(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
    model: str | None = None,
    which: Literal[1, 2] | None = None,
    size_px: tuple[int, int] | None = None,
) -> Imported:
    """Import a camera's lens from a file written with OpenCV.

    Reads FileStorage (.yml, .xml, .json) and NumPy archives (.npz). The camera
    matrix is named camera_matrix, cameraMatrix, mtx or K, the distortion
    coefficients distortion_coefficients, distCoeffs, dist or D. The lens replaces
    the intrinsics in cell.yaml; the size must be that of the recorded images.

    For example:

        basecal import opencv mycell calibration.yml --camera wrist
        basecal import opencv mycell lens.npz --camera wrist --size-px 1280 720

    Args:
        cell: Folder of the cell.
        file: File written by OpenCV or NumPy.
        camera: Name of the camera; may be omitted if the cell has one.
        on: Carrier of a new camera: a robot, or world.
        status: Whether the intrinsics are fixed, or free with these values as the initial guess.
        model: Lens model, if the file does not state a fisheye.
        which: Number of the camera, if the file has two (M1, D1 and M2, D2).
        size_px: Width and height of the images, if the file does not state them.

    Raises:
        InputError: if the file cannot be read, is inconsistent with the cell, or the images have another size.
    """
    lens = read_opencv_lens(file, model, which)
    stated = lens.camera.size_px
    if size_px is not None and stated not in (None, size_px):
        raise InputError(f"{file} is of {stated[0]} x {stated[1]} px: omit --size-px, or correct the file")
    if size_px is not None:
        lens = replace(lens, camera=Camera(lens.camera.model, lens.camera.parameters, size_px))
    return lens_of_file(cell, lens, file, camera, on, status)


def read_opencv_lens(path: str | Path, model: str | None = None, number: int | None = None) -> StatedLens:
    """Read a lens from a file written by OpenCV or NumPy.

    Args:
        path: `.yml`, `.yaml`, `.xml`, `.json`, or `.npz`.
        model: Lens model; if None, as stated in the file, else the pinhole.
        number: Number of the camera, if the file has two: 1 for M1, D1, or 2 for M2, D2.

    Raises:
        DatasetError: if the camera matrix is missing, ambiguous or invalid.
    """
    name = str(path)
    if name.lower().endswith((".npz", ".npy")):
        file, arrays = read_arrays(name)
        root = Field(file, {key: array.ravel().tolist() for key, array in arrays.items()}, {})
    else:
        root = read_file_storage(path)
    if (ros := root.first("distortion_model")) is not None:
        raise ros.error("belongs to a file of ROS, not of OpenCV: basecal import camera-info")
    named = _fields_by_name(root)
    suffix = "" if number is None else str(number)
    matrix = _first_matrix(named, (f"{each}{suffix}" for each in _MATRIX), _MATRIX_SIZE)
    terms = _first_matrix(named, (f"{each}{suffix}" for each in _TERMS))
    values = [] if terms is None else _whole_matrix(terms)
    if matrix is not None:
        what, parameters = f"OpenCV's {matrix.loc[-1]}", matrix_parameters(matrix, matrix.matrix(_MATRIX_SIZE))
    elif all(name in named for name in _FOCAL_AND_CENTRE):
        what, parameters = "fx, fy, cx, cy", _scalars(named, _FOCAL_AND_CENTRE)
        values = values or _scalars(named, _TERM_NAMES)
    else:
        raise _no_matrix(root, named, number)
    is_fisheye = next((named[each] for each in _FISHEYE if each in named), None)
    lens = model or ("fisheye" if is_fisheye is not None and is_fisheye.boolean() else "pinhole")
    size = _size(named)
    distortion = values if len(values) in term_counts(lens) else opencv_terms(terms or root, values)
    return StatedLens(
        make_camera(terms or matrix or root, lens, [*parameters, *distortion], size),
        f"{what}, {lens} of {count_text(len(distortion), 'distortion term')}"
        f"{'' if size is None else f', {size[0]} x {size[1]} px'}, the centre of the top-left pixel is (0, 0)",
    )


def _whole_matrix(field: Field) -> list[float]:
    """Numbers of a matrix, as many as its fields `rows` and `cols` state.

    Raises:
        DatasetError: if there are more or fewer.
    """
    values, sides = field.matrix(), [field.first("rows"), field.first("cols")]
    rows, columns = (1 if side is None else side.integer(0) for side in sides)
    if None not in sides and rows * columns != len(values):
        raise field.error(
            f"has {count_text(len(values), 'number')}, its rows and cols state {rows} x {columns}: is it cut off?"
        )
    return values


def _scalars(fields: dict[str, Field], names: Sequence[str]) -> list[float]:
    """Numbers of separate fields, up to the last existing one; missing numbers are zero."""
    count = max((k + 1 for k, name in enumerate(names) if name in fields), default=0)
    return [_scalar(fields[name]).number() if name in fields else 0.0 for name in names[:count]]


def _no_matrix(root: Field, fields: dict[str, Field], number: int | None) -> DatasetError:
    """Error about a file without a camera matrix, or with two."""
    if number is None and _first_matrix(fields, (f"{each}1" for each in _MATRIX), _MATRIX_SIZE) is not None:
        return root.error(f"holds two cameras ({list_names(root.names())}): choose --which 1 or --which 2")
    expected = "expected camera_matrix, cameraMatrix, mtx or K, 3 x 3"
    return root.error(f"has no camera matrix; it has {list_names(root.names())}: {expected}")


def _fields_by_name(root: Field) -> dict[str, Field]:
    """Fields by name in lower case without underscores and hyphens, including those of nested mappings."""
    found: dict[str, Field] = {}
    for name in root.names():
        field = root.first(name)
        if field is None:
            continue
        if isinstance(field.data, dict) and "data" not in field.data:
            found |= {**_fields_by_name(field), **found}
        found[name.replace("_", "").replace("-", "").lower()] = field
    return found


def _first_matrix(fields: dict[str, Field], names: Iterable[str], count: int | None = None) -> Field | None:
    """First field with a matrix, of `count` numbers if given; None if there is none."""
    for name in names:
        field = fields.get(name)
        rows = None if field is None else (field.first("data") or field).data
        if isinstance(rows, list) and count in (None, sum(len(row) if isinstance(row, list) else 1 for row in rows)):
            return field
    return None


def _size(fields: dict[str, Field]) -> tuple[int, int] | None:
    width = next((fields[name] for name in _WIDTHS if name in fields), None)
    height = next((fields[name] for name in _HEIGHTS if name in fields), None)
    if width is not None and height is not None:
        return (_scalar(width).integer(), _scalar(height).integer())
    sides = next((fields[name] for name in _SIZE if name in fields), None)
    if sides is None or not isinstance(sides.data, list) or len(sides.data) != 2:
        return None
    first, second = sides.items("width and height")
    return (first.integer(), second.integer())


def _scalar(field: Field) -> Field:
    """Field of a number that NumPy may store as an array."""
    return field.items("one number")[0] if isinstance(field.data, list) else field
