"""SIFT features of an image, evenly distributed, with their descriptors."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.bounded_file import read_bounded
from basecal.cell.format.described_places import DESCRIPTOR_LENGTH, points_from_bytes, points_to_bytes, row_bytes
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError, InputError
from basecal.geometry import Array, IntArray
from basecal.vision.detection import Image, eight_bit

MAX_FEATURES = 2500  # per image
_CELLS = 24, 16  # of the grid in which features are distributed, strongest first
_CONTRAST = 0.02  # half of OpenCV's default: too many features are thinned evenly
_CLIP, _TILES = 2.0, (8, 8)  # of the histogram equalisation
_HULL_FACTOR = 1.3  # factor by which a mask is enlarged about its centre

_LEVELS = 255.0  # levels in a byte for a descriptor's numbers between 0 and 1

Descriptors = NDArray[np.float32]
VERSION = 1
"""Version of the features: increase it whenever their computation changes."""

_FOLDER = Path("derived", "features")


@dataclass(frozen=True, eq=False)
class Features:
    """Features of an image.

    Attributes:
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
        descriptors: (n, 128) of unit length.
    """

    pixels: Array
    descriptors: Descriptors

    def __len__(self) -> int:
        return len(self.pixels)


def find_features(image: Image, excluded_pixels: Sequence[Array] = ()) -> Features:
    """Detect at most `MAX_FEATURES` features outside of excluded areas.

    The features are SIFT (Lowe 2004) with precise upscaling, without which all positions are offset by a quarter pixel.
    Descriptors are RootSIFT (Arandjelovic & Zisserman 2012).

    Args:
        image: Grey levels.
        excluded_pixels: Pixels of moving targets, (k, 2) each; their enlarged convex hulls are excluded.
    """
    grey = cv2.createCLAHE(_CLIP, _TILES).apply(eight_bit(image))
    finder = cv2.SIFT.create(contrastThreshold=_CONTRAST, enable_precise_upscale=True)
    points = finder.detect(grey, _mask(grey.shape, excluded_pixels))
    if not points:
        return Features(np.zeros((0, 2)), np.zeros((0, DESCRIPTOR_LENGTH), dtype=np.float32))
    pixels = np.array([point.pt for point in points])
    kept = _distributed_indices(pixels, np.array([point.response for point in points]), grey.shape)
    points, descriptors = finder.compute(grey, [points[k] for k in kept])
    shares = np.sqrt(descriptors / np.maximum(descriptors.sum(1, keepdims=True), 1e-9))
    return Features(np.array([point.pt for point in points]), shares.astype(np.float32))


def identified_features(numbers: IntArray, pixels: Array) -> Features:
    """Features of identified points: the descriptor is a pseudo-random direction seeded by the point's number.

    Args:
        numbers: Numbers of the points, (n,).
        pixels: (n, 2) [px].
    """
    generators = [np.random.default_rng(int(number) % 2**64) for number in numbers]
    directions = np.array([rng.standard_normal(DESCRIPTOR_LENGTH) for rng in generators])
    return Features(pixels, unit_descriptors(np.abs(directions.reshape(-1, DESCRIPTOR_LENGTH))))


def descriptor_levels(descriptors: Descriptors) -> NDArray[np.uint8]:
    """Quantise descriptors to bytes."""
    return np.round(descriptors * _LEVELS).astype(np.uint8)


def unit_descriptors(rows: NDArray[np.generic]) -> Descriptors:
    """Normalise sums or levels of descriptors, (n, 128), to unit length; zero remains zero."""
    numbers = rows.astype(np.float32)
    return np.asarray(numbers / np.maximum(np.linalg.norm(numbers, axis=1, keepdims=True), 1e-9), dtype=np.float32)


def _mask(shape: tuple[int, ...], excluded_pixels: Sequence[Array]) -> NDArray[np.uint8]:
    mask = np.full(shape, 255, dtype=np.uint8)
    for pixels in excluded_pixels:
        if len(pixels) < 3:
            continue
        hull = cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2)
        middle = hull.mean(0)
        cv2.fillPoly(mask, [np.round(middle + _HULL_FACTOR * (hull - middle)).astype(np.int32)], 0)
    return mask


def _distributed_indices(pixels: Array, response: Array, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Indices of evenly distributed features: the strongest of each cell first, one per position."""
    strongest = np.argsort(-response, kind="stable")
    strongest = strongest[np.sort(np.unique(np.round(pixels[strongest], 2), axis=0, return_index=True)[1])]
    columns, rows = _CELLS
    positions = (pixels[strongest] * [columns / shape[1], rows / shape[0]]).astype(np.int64)
    cell = np.clip(positions[:, 0], 0, columns - 1) + columns * np.clip(positions[:, 1], 0, rows - 1)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], cell[order])
    rank = np.empty(len(strongest), dtype=np.int64)
    rank[order] = np.arange(len(strongest)) - first
    return strongest[np.argsort(rank, kind="stable")[:MAX_FEATURES]]


def cached_features(folder: Path, image_key: str, image: Image, excluded_pixels: Sequence[Array]) -> Features:
    """Features of an image, from the cache or detected and then cached.

    Args:
        folder: The cell's folder.
        image_key: Hash of the image's file.
        image: Grey levels.
        excluded_pixels: Pixels of moving targets; see `find_features`.
    """
    parts = [str(VERSION).encode(), image_key.encode(), *(each.tobytes() for each in excluded_pixels)]
    path = folder / _FOLDER / hashlib.sha256(b"|".join(parts)).hexdigest()
    arrays = _read(path)
    if arrays is None:
        features = find_features(image, excluded_pixels)
        arrays = features.pixels, descriptor_levels(features.descriptors)
        with suppress(InputError):  # without a writable folder there is no cache
            write_atomically(path, points_to_bytes(*arrays), base_folder=folder, durable=False)
    return Features(arrays[0], unit_descriptors(arrays[1]))


def _read(path: Path) -> tuple[Array, NDArray[np.uint8]] | None:
    try:
        return points_from_bytes(read_bounded(path, MAX_FEATURES * row_bytes(2)), 2)
    except DatasetError:
        return None
