"""Reading of the lenses of a COLMAP reconstruction: `cameras.txt` or `cameras.bin`.

COLMAP's pixel origin is the corner of the image: the centre of the top-left pixel is (0.5, 0.5) there and (0, 0) here.
Half a pixel is therefore subtracted from the principal point. A single focal length is used for x and y; missing radial
terms are zero.
Source: COLMAP's documentation, "Output Format", "Camera Models" and "Database Format"; src/colmap/sensor/models.h.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, count_text, list_names, spelling_hint
from basecal.exchange.columns import read_table_text
from basecal.exchange.fields import Field, parse_float
from basecal.exchange.importing.lens import StatedLens, make_camera
from basecal.fields.problems import shorten

_TO_PIXEL_CENTRES = -0.5
_LARGEST = 2**24  # bytes: a hundred thousand cameras


@dataclass(frozen=True)
class _Model:
    """A camera model of COLMAP.

    Attributes:
        number: Number of the model in binary files.
        count: Number of parameters.
        lens: Name of the lens model in basecal; None if the model is not supported.
        focals: Number of focal lengths, which are the first parameters.
        terms: For each distortion term of the lens, its index in the parameters after the principal point; None for
            zero.
    """

    number: int
    count: int
    lens: str | None = None
    focals: int = 2
    terms: tuple[int | None, ...] = ()


_MODELS = {
    "SIMPLE_PINHOLE": _Model(0, 3, "pinhole", 1),
    "PINHOLE": _Model(1, 4, "pinhole"),
    "SIMPLE_RADIAL": _Model(2, 4, "pinhole", 1, (0, None, None, None)),
    "RADIAL": _Model(3, 5, "pinhole", 1, (0, 1, None, None)),
    "OPENCV": _Model(4, 8, "pinhole", 2, (0, 1, 2, 3)),
    "OPENCV_FISHEYE": _Model(5, 8, "fisheye", 2, (0, 1, 2, 3)),
    "FULL_OPENCV": _Model(6, 12, "pinhole", 2, (0, 1, 2, 3, 4, 5, 6, 7)),
    "FOV": _Model(7, 5),
    "SIMPLE_RADIAL_FISHEYE": _Model(8, 4, "fisheye", 1, (0, None, None, None)),
    "RADIAL_FISHEYE": _Model(9, 5, "fisheye", 1, (0, 1, None, None)),
    "THIN_PRISM_FISHEYE": _Model(10, 12),
    "RAD_TAN_THIN_PRISM_FISHEYE": _Model(11, 16),
}
_BY_NUMBER = {model.number: name for name, model in _MODELS.items()}


class _Entry(NamedTuple):
    """A camera of a file: its number, model, size and parameters; `location` is for errors."""

    number: int
    model: str
    size_px: tuple[int, int]
    parameters: Sequence[float]
    location: Field


def read_colmap_lenses(path: str | Path) -> dict[int, StatedLens]:
    """Read the lenses of a reconstruction by their CAMERA_ID.

    Args:
        path: `cameras.txt`, `cameras.bin`, or the folder that holds one of them; the binary file is preferred, as in
            COLMAP.

    Raises:
        DatasetError: if the file is neither, or a lens model is not supported.
    """
    file = reconstruction_file(path, "cameras")
    entries = list(_binary(file) if file.suffix.lower() == ".bin" else _text(file))
    if not entries:
        raise DatasetError(file, "holds no camera, expected lines `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`")
    lenses: dict[int, StatedLens] = {}
    for entry in entries:
        if entry.number in lenses:
            raise entry.location.error(f"camera {entry.number} is given twice: keep one")
        lenses[entry.number] = _lens(entry)
    return lenses


def reconstruction_file(path: str | Path, name: str) -> Path:
    """Path of a reconstruction's file; in a folder, the binary file of this name, else the text file.

    Raises:
        DatasetError: if the folder has neither.
    """
    file = Path(path)
    if not file.is_dir():
        return file
    for each in (file / f"{name}.bin", file / f"{name}.txt"):
        if each.exists():
            return each
    why = f"cannot be read: holds neither {name}.bin nor {name}.txt; give a reconstruction's folder"
    raise DatasetError(path, why)


def _text(path: Path) -> Iterator[_Entry]:
    lines = read_table_text(str(path), "lines `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`").splitlines()
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].split()
        location = Field(str(path), words, {(): number})
        if not words:
            continue
        if len(words) < 5:
            raise location.error(f"{count_text(len(words), 'word')}, expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]")
        try:
            sides = (int(words[2]), int(words[3]))
            yield _Entry(int(words[0]), words[1], sides, [parse_float(word) for word in words[4:]], location)
        except ValueError:
            raise location.error(f"{shorten(line)} has a word that is not a number, behind the model's name") from None


def _binary(path: Path) -> Iterator[_Entry]:
    """Parse the little-endian file: camera count, then id, model number, width, height and parameters of each."""
    data = read_bounded(path, _LARGEST)
    try:
        (count,) = struct.unpack_from("<Q", data)
        offset = 8
        for i in range(count):
            location = Field(str(path), None, {}, (f"camera {i}",))
            number, model, width, height = struct.unpack_from("<iiQQ", data, offset)
            if model not in _BY_NUMBER:
                raise location.error(f"is of model {model}, expected 0 to {max(_BY_NUMBER)}: is this cameras.bin?")
            size = _MODELS[_BY_NUMBER[model]].count
            yield _Entry(
                number, _BY_NUMBER[model], (width, height), struct.unpack_from(f"<{size}d", data, offset + 24), location
            )
            offset += 24 + 8 * size
    except struct.error:
        raise DatasetError(path, "is cut off, or is not cameras.bin of COLMAP") from None


def _lens(entry: _Entry) -> StatedLens:
    model = _MODELS.get(entry.model)
    if model is None:
        known = [name for name, each in _MODELS.items() if each.lens]
        raise entry.location.error(
            f"no model {shorten(entry.model)}{spelling_hint(entry.model, known)}; there are: {list_names(known)}"
        )
    if model.lens is None:
        raise entry.location.error(f"{entry.model} is not supported: calibrate with OPENCV or OPENCV_FISHEYE")
    if len(entry.parameters) != model.count:
        raise entry.location.error(f"{count_text(len(entry.parameters), 'parameter')}, {entry.model} has {model.count}")
    location = entry.location
    values = Field(location.path, list(entry.parameters), location.lines, location.loc).numbers()
    focal, (cx, cy), rest = (
        values[: model.focals],
        values[model.focals : model.focals + 2],
        values[model.focals + 2 :],
    )
    fx, fy = focal * (3 - model.focals)
    terms = [0.0 if index is None else rest[index] for index in model.terms]
    centre = (cx + _TO_PIXEL_CENTRES, cy + _TO_PIXEL_CENTRES)
    width, height = entry.size_px
    return StatedLens(
        make_camera(entry.location, model.lens, [fx, fy, *centre, *terms], entry.size_px),
        f"camera {entry.number} of COLMAP, {entry.model}, {width} x {height} px. Half a pixel is subtracted from its "
        "principal point, since COLMAP's top-left pixel has its centre at (0.5, 0.5)",
        str(entry.number),
    )
