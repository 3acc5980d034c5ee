"""Features kept in `derived/features/`, named by the hash of all they depend on; a broken file is no file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from basecal.bounded_file import read_bounded
from basecal.cell.format.described_places import places_from_bytes, places_to_bytes, row_bytes
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError, InputError
from basecal.geometry import Array
from basecal.vision.detection import Image
from basecal.vision.tracks.features import MAX_FEATURES, Features, descriptor_levels, find_features, unit_descriptors

VERSION = 1
"""Raised whenever features are found otherwise."""

_FOLDER = Path("derived", "features")


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
    if kept is None:
        found = find_features(image, excluded_pixels)
        kept = found.pixels, descriptor_levels(found.descriptors)
        with suppress(InputError):  # a folder that cannot be written to is only slower the next time
            write_atomically(path, places_to_bytes(*kept), base_folder=folder, durable=False)
    return Features(kept[0], unit_descriptors(kept[1]))


def _read(path: Path) -> tuple[Array, NDArray[np.uint8]] | None:
    try:
        return places_from_bytes(read_bounded(path, MAX_FEATURES * row_bytes(2)), 2)
    except DatasetError:
        return None
