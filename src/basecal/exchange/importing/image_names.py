"""Names of images that tables of poses state before the images are imported, with the samples of their rows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import read_text
from basecal.errors import DatasetError

_FILE = "recording/image_names.json"
_LARGEST = 2**24  # bytes: 200,000 names


def read_image_names(folder: Path) -> dict[str, int]:
    """Read the sample numbers by image name that earlier tables of a cell defined.

    Raises:
        DatasetError: if the file is invalid.
    """
    path = folder / _FILE
    if not path.exists():
        return {}
    try:
        data = json.loads(read_text(path, "", _LARGEST))["samples_by_image"]
        return {str(name): int(number) for name, number in data.items()}
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError):
        expected = 'expected {"samples_by_image": {"name": 0}}; remove it and import the table again'
        raise DatasetError(path, expected) from None


def write_image_names(folder: Path, samples_by_image: Mapping[str, int]) -> None:
    """Write the sample numbers by image name into a cell."""
    text = json.dumps({"samples_by_image": dict(samples_by_image)}) + "\n"
    write_atomically(folder / _FILE, text, base_folder=folder)
