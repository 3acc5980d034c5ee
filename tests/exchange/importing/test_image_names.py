"""Tests of names of images that are imported after their table."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.errors import DatasetError
from basecal.exchange.importing.image_names import read_image_names, write_image_names


def test_image_names_round_trip(tmp_path: Path) -> None:
    """A cell without stored names has none."""
    assert read_image_names(tmp_path) == {}
    write_image_names(tmp_path, {"IMG_1": 0, "größe 2": 7})
    assert read_image_names(tmp_path) == {"IMG_1": 0, "größe 2": 7}


@pytest.mark.parametrize(
    "text", ['{"samples_by_image": {"a": Infinity}}', '{"samples_by_image": 1}', "[" * 100_000, ""]
)
def test_damaged_image_names_are_reported(text: str, tmp_path: Path) -> None:
    """Damaged names of an earlier table are an error that states what to remove."""
    write_image_names(tmp_path, {"a": 0})
    (tmp_path / "recording" / "image_names.json").write_text(text)
    with pytest.raises(DatasetError, match=r"image_names\.json: expected .* remove it and import the table again"):
        read_image_names(tmp_path)
