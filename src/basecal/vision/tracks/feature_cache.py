"""Features kept in `derived/features/`, named by the hash of all they depend on; a broken file is no file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from basecal.bounded_file import read_bounded
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError, InputError
from basecal.geometry import Array
from basecal.vision.detection import Image
from basecal.vision.tracks.features import DESCRIPTOR, MAX_FEATURES, Features, find_features

VERSION = 1
"""Raised whenever features are found otherwise."""

_FOLDER = Path("derived", "features")
_PIXEL_BYTES = 16
_ROW_BYTES = _PIXEL_BYTES + DESCRIPTOR
_SCALE = 255.0  # of a descriptor's entries, which are between 0 and 1, in a byte


def kept_features(folder: Path, image_key: str, image: Image, excluded_pixels: Sequence[Array]) -> Features:
    """The features of an image: those kept, or found now and kept.

    Args:
        folder: Of the cell.
        image_key: Hash of the image's file.
        image: Grey levels.
        excluded_pixels: Of targets that move; see `find_features`.
    """
    parts = [str(VERSION).encode(), image_key.encode(), *(each.tobytes() for each in excluded_pixels)]
    path = folder / _FOLDER / hashlib.sha256(b"|".join(parts)).hexdigest()
    kept = _read(path)
    if kept is not None:
        return kept
    found = find_features(image, excluded_pixels)
    _write(folder, path, found)
    return _from_levels(found.pixels, _levels(found))


def _levels(features: Features) -> NDArray[np.uint8]:
    return np.round(features.descriptors * _SCALE).astype(np.uint8)


def _from_levels(pixels: Array, levels: NDArray[np.uint8]) -> Features:
    descriptors = levels.astype(np.float32)
    descriptors /= np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
    return Features(pixels, descriptors)


def _read(path: Path) -> Features | None:
    try:
        data = read_bounded(path, MAX_FEATURES * _ROW_BYTES)
    except DatasetError:
        return None
    count, rest = divmod(len(data), _ROW_BYTES)
    if rest:
        return None
    pixels = np.frombuffer(data, dtype="<f8", count=2 * count).reshape(count, 2)
    levels = np.frombuffer(data, dtype=np.uint8, offset=_PIXEL_BYTES * count).reshape(count, DESCRIPTOR)
    return _from_levels(pixels.astype(np.float64), levels) if np.isfinite(pixels).all() else None


def _write(folder: Path, path: Path, features: Features) -> None:
    """Keep features; a folder that cannot be written to is only slower the next time."""
    with suppress(InputError):
        content = features.pixels.astype("<f8").tobytes() + _levels(features).tobytes()
        write_atomically(path, content, base_folder=folder, durable=False)
