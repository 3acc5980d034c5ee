"""Import of a lens from a `.cameramodel` of mrcal: a Python literal, read as data.

The parameters are fx fy cx cy and OpenCV's terms in OpenCV's order. The converters of mrcal from and to ROS and OpenCV
do not change them, so the centre of the top-left pixel is (0, 0). Extrinsics are ignored: they refer to the rig of the
calibration. Source: mrcal's "cameramodel" documentation and its `cameramodel.py`, including older names of keys.
"""

from __future__ import annotations

import ast
import warnings
from pathlib import Path
from typing import Any

from basecal.errors import DatasetError, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.fields import Field
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, StatedLens, lens_of_file, make_camera
from basecal.fields.problems import Loc, shorten

_TERMS = {
    "LENSMODEL_PINHOLE": 0,
    "LENSMODEL_OPENCV4": 4,
    "LENSMODEL_OPENCV5": 5,
    "LENSMODEL_OPENCV8": 8,
    "LENSMODEL_OPENCV12": 12,
}
_NOT_LITERALS = (SyntaxError, ValueError, TypeError, MemoryError, RecursionError)


def read_mrcal(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
) -> Imported:
    """Import a camera's lens from a .cameramodel of mrcal.

    LENSMODEL_PINHOLE and LENSMODEL_OPENCV4, 5, 8 and 12 are supported;
    extrinsics are ignored. The lens replaces the intrinsics in cell.yaml; the
    size must be that of the recorded images.

    For example:

        basecal import mrcal mycell camera-0.cameramodel --camera wrist

    Args:
        cell: Folder of the cell.
        file: The cameramodel.
        camera: Name of the camera; may be omitted if the cell has one.
        on: Carrier of a new camera: a robot, or world.
        status: Whether the intrinsics are fixed, or free with these values as the initial guess.

    Raises:
        InputError: if the file cannot be read, is inconsistent with the cell, or the images have another size.
    """
    return lens_of_file(cell, read_cameramodel(file), file, camera, on, status)


def read_cameramodel(path: str | Path) -> StatedLens:
    """Read the lens of a `.cameramodel`.

    Raises:
        DatasetError: if the file is invalid, or the lens model is not supported.
    """
    root = _literal(str(path))
    kind = root.find("lensmodel", "lens_model", "distortion_model")
    name = kind.text().replace("DISTORTION", "LENSMODEL")
    if name not in _TERMS:
        advice = "mrcal-convert-lensmodel fits a supported model"
        raise kind.error(f"{shorten(name)} is not supported ({list_names(list(_TERMS))}): {advice}")
    values = root.find("intrinsics")
    width, height = root.find("imagersize").size()
    camera = make_camera(values, "pinhole", values.numbers(4 + _TERMS[name]), (width, height))
    return StatedLens(
        camera, f"cameramodel of mrcal, {name}, {width} x {height} px, the centre of the top-left pixel is (0, 0)"
    )


def _literal(path: str) -> Field:
    """Parse the dictionary of a file and the lines of its keys; expressions other than literals are rejected."""
    text = read_table_text(path, "a cameramodel of mrcal, which is text")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about invalid escapes in strings
            tree = ast.parse(text.strip(), path, "eval").body
            if not isinstance(tree, ast.Dict):
                raise DatasetError(path, "is not the dictionary that a cameramodel of mrcal is")
            data: dict[str, Any] = {}
            lines: dict[Loc, int] = {(): 1}
            lines_before = text[: len(text) - len(text.lstrip())].count("\n")
            for key, value in zip(tree.keys, tree.values, strict=True):
                name = str(ast.literal_eval(key or value))
                if name in data:
                    raise DatasetError(path, "is given twice: keep one", lines_before + value.lineno, name)
                data[name] = _as_lists(ast.literal_eval(value))
                lines[(name,)] = lines_before + value.lineno
    except DatasetError:
        raise
    except _NOT_LITERALS as error:
        line = error.lineno if isinstance(error, SyntaxError) else None
        raise DatasetError(
            path, "is not a cameramodel of mrcal: not a Python dictionary of plain values", line
        ) from None
    return Field(path, data, lines)


def _as_lists(value: Any) -> Any:
    return [_as_lists(each) for each in value] if isinstance(value, list | tuple) else value
