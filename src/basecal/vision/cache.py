"""A cache of detections in `derived/detections/`, keyed by a hash of their inputs; broken files are ignored."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.cell.format.paths import own_file
from basecal.cell.format.writing import write_atomically
from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.geometry import read_only, read_only_ids
from basecal.vision.detection import Detection

VERSION = 6
"""Version of the detectors: increase it whenever their results change."""

_FOLDER = Path("derived", "detections")
_LARGEST_BYTES = 2**26  # of a million points


def key(target: Target, size_px: tuple[int, int] | None, image: bytes, background: bytes | None) -> str:
    """Hash of an image, its required size, its background image, a target and the detectors' version."""
    description = json.dumps([VERSION, target.kind, dict(target.options), size_px], sort_keys=True)
    parts = [description.encode(), image, background or b""]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def read(folder: Path, name: str) -> tuple[Detection | None] | None:
    """The cached detection in a tuple, (None,) if no target was detected; None if the cache has no valid entry."""
    try:
        data = json.loads(read_bounded(own_file(folder, str(_FOLDER / f"{name}.json")), _LARGEST_BYTES))
        if data["pixels"] is None:
            return (None,)
        pixels, sigma_px = read_only(data["pixels"], (None, 2)), read_only(data["sigma_px"], (len(data["pixels"]),))
        ids = None if data["ids"] is None else read_only_ids(data["ids"])
        is_valid = len(pixels) > 0 and bool(np.all(np.isfinite(pixels))) and bool(np.all(sigma_px > 0))
        if not is_valid or (ids is not None and ids.shape != (len(pixels),)):
            return None
        return (Detection(ids, pixels, sigma_px),)
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None


def write(folder: Path, name: str, detection: Detection | None) -> None:
    """Store a detection in the cache; do nothing if the folder cannot be written to."""
    data = {"ids": None, "pixels": None, "sigma_px": None}
    if detection is not None:
        ids = None if detection.ids is None else detection.ids.tolist()
        data = {"ids": ids, "pixels": detection.pixels.tolist(), "sigma_px": detection.sigma_px.tolist()}
    try:
        write_atomically(folder / _FOLDER / f"{name}.json", json.dumps(data), base_folder=folder, durable=False)
    except InputError:
        return
