"""The lens that a script wrote with OpenCV: FileStorage (YAML, XML, JSON) or a NumPy archive, under the usual names.

The pixels are OpenCV's: the centre of the top-left pixel is (0, 0). Four terms are k1 k2 p1 p2 or the fisheye's. Only
the file's `fisheye_model`, or the user, can decide that. Source: OpenCV's tutorials on camera calibration, whose sample
writes camera_matrix and distortion_coefficients and whose Python page writes mtx and dist; stereo_calib's M1, D1.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from basecal.errors import list_names
from basecal.exchange.fields import Field
from basecal.exchange.lens_files.file_storage import read_file_storage
from basecal.exchange.lens_files.stated_lens import StatedLens, made_camera, matrix_parameters, opencv_terms
from basecal.exchange.npz import read_arrays
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


def read_opencv(path: str | Path, model: str | None = None, number: int | None = None) -> StatedLens:
    """The lens of a file that OpenCV, or NumPy in a script, wrote.

    Args:
        path: `.yml`, `.yaml`, `.xml`, `.json`, or `.npz`.
        model: What it is of; the file's word, else the pinhole, where None.
        number: Of two cameras in a file, 1 or 2: M1, D1 or M2, D2.

    Raises:
        DatasetError: if there is no camera matrix, or there are two and none is chosen, or it is no lens.
    """
    name = str(path)
    if name.lower().endswith((".npz", ".npy")):
        file, arrays = read_arrays(name)
        root = Field(file, {key: array.ravel().tolist() for key, array in arrays.items()}, {})
    else:
        root = read_file_storage(path)
    if (ros := root.first("distortion_model")) is not None:
        raise ros.error("says how ROS distorts, which OpenCV does not write: basecal import camera-info")
    named = _fields_by_name(root)
    suffix = "" if number is None else str(number)
    matrix = _first_matrix(named, (f"{each}{suffix}" for each in _MATRIX), _MATRIX_SIZE)
    if matrix is None and all(name in named for name in _FOCAL_AND_CENTRE):
        return _lens_of_numbers(root, named, model or "pinhole")
    if matrix is None:
        both = _first_matrix(named, (f"{each}1" for each in _MATRIX), _MATRIX_SIZE)
        if number is None and both is not None:
            raise root.error(f"holds two cameras ({list_names(list(root.data))}): say which by --which 1 or --which 2")
        expected = "expected camera_matrix, cameraMatrix, mtx or K, 3 x 3"
        raise root.error(f"has no camera matrix; it has {list_names(_names(root))}: {expected}")
    terms = _first_matrix(named, (f"{each}{suffix}" for each in _TERMS))
    values = [] if terms is None else _data(terms).numbers()
    said = next((named[each] for each in _FISHEYE if each in named), None)
    lens = model or ("fisheye" if said is not None and said.boolean() else "pinhole")
    parameters = matrix_parameters(matrix, _data(matrix).numbers(_MATRIX_SIZE))
    size = _size(named)
    usual = values if len(values) in term_counts(lens) else opencv_terms(terms or root, values)
    return StatedLens(
        made_camera(terms or matrix, lens, [*parameters, *usual], size),
        f"OpenCV's {matrix.loc[-1]}, {lens} of {len(usual)} distortion terms"
        f"{'' if size is None else f', {size[0]} x {size[1]} px'}, the centre of the top-left pixel is (0, 0)",
    )


def _lens_of_numbers(root: Field, fields: dict[str, Field], lens: str) -> StatedLens:
    """A lens of a file that has fx, fy, cx, cy each under its name, and terms so or as a list."""
    listed = _first_matrix(fields, _TERMS)
    if listed is not None:
        values = _data(listed).numbers()
    else:
        count = max((k + 1 for k, name in enumerate(_TERM_NAMES) if name in fields), default=0)
        values = [_scalar(fields[name]).number() if name in fields else 0.0 for name in _TERM_NAMES[:count]]
    usual = values if len(values) in term_counts(lens) else opencv_terms(listed or root, values)
    parameters = [_scalar(fields[name]).number() for name in _FOCAL_AND_CENTRE]
    size = _size(fields)
    return StatedLens(
        made_camera(root, lens, [*parameters, *usual], size),
        f"fx, fy, cx, cy, {lens} of {len(usual)} distortion terms, the centre of the top-left pixel is (0, 0)",
    )


def _names(root: Field) -> list[str]:
    return list(root.data) if isinstance(root.data, dict) else []


def _fields_by_name(root: Field) -> dict[str, Field]:
    """Fields by name without underscores in lower case, also those one mapping deeper."""
    found: dict[str, Field] = {}
    for name in _names(root):
        field = root.first(name)
        if field is None:
            continue
        if isinstance(field.data, dict) and "data" not in field.data:
            found |= {**_fields_by_name(field), **found}
        found[str(name).replace("_", "").replace("-", "").lower()] = field
    return found


def _first_matrix(fields: dict[str, Field], names: Iterable[str], count: int | None = None) -> Field | None:
    """The first field that holds a matrix, of `count` numbers where given."""
    for name in names:
        field = fields.get(name)
        rows = None if field is None else _data(field).data
        if isinstance(rows, list) and count in (None, sum(len(row) if isinstance(row, list) else 1 for row in rows)):
            return field
    return None


def _data(field: Field) -> Field:
    """The numbers of a matrix, which FileStorage has beside its `rows` and `cols`."""
    return field.find("data") if isinstance(field.data, dict) else field


def _size(fields: dict[str, Field]) -> tuple[int, int] | None:
    width = next((fields[name] for name in _WIDTHS if name in fields), None)
    height = next((fields[name] for name in _HEIGHTS if name in fields), None)
    if width is not None and height is not None:
        return (_scalar(width).integer(), _scalar(height).integer())
    both = next((fields[name] for name in _SIZE if name in fields), None)
    if both is None or not isinstance(both.data, list) or len(both.data) != 2:
        return None
    first, second = both.items("width and height")
    return (first.integer(), second.integer())


def _scalar(field: Field) -> Field:
    """A number that NumPy keeps as an array."""
    return field.items("one number")[0] if isinstance(field.data, list) else field
