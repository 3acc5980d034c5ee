"""Tests of `truth.yaml`, which stores the transforms of a simulated cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from basecal.cell.files import read_truth, write_truth
from basecal.cell.results.truth_file import read_truth_extra
from basecal.errors import DatasetError
from basecal.geometry import SE3


def test_round_trip(tmp_path: Path) -> None:
    """Names and transforms are read back, for numbers of every magnitude."""
    random = np.random.default_rng(1)
    truth = {f"a_from_{k}": SE3.exp(random.normal(size=6) * 10.0 ** (k - 9)) for k in range(10)}
    write_truth(tmp_path, truth, seed=7, sigmas={"pixel_px": 0.3})
    read = read_truth(tmp_path)
    assert list(read) == list(truth)
    for name, transform in truth.items():
        assert_array_equal(read[name].translation, transform.translation)
        assert_allclose(read[name].rotation, transform.rotation, atol=4e-15)
    assert "seed: 7\nsigmas: {pixel_px: 0.3}" in (tmp_path / "truth.yaml").read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("schema: basecal/truth/2\ntransforms: {}", "truth.yaml:1: schema: expected"),
        ("schema: basecal/truth/1", "transforms: missing; add it"),
        ("schema: basecal/truth/1\ntransforms:\n  a: {t_m: [0, 0, 0]}", "truth.yaml:3: transforms.a: expected t_m and"),
        ("schema: basecal/truth/1\ntransforms:\n  a: {t: 0}", "truth.yaml:3: transforms.a.t: unknown field"),
    ],
)
def test_invalid_truth_is_refused(tmp_path: Path, text: str, words: str) -> None:
    """An unreadable truth is an error with line and field."""
    (tmp_path / "truth.yaml").write_text(text)
    with pytest.raises(DatasetError) as caught:
        read_truth(tmp_path)
    assert words in str(caught.value)


def test_extra_truth_fields_are_read_back(tmp_path: Path) -> None:
    """All fields except the transforms and the version are read back."""
    write_truth(tmp_path, {"a_from_b": SE3.identity()}, seed=7, sigmas={"pixel_px": 0.3})
    assert read_truth_extra(tmp_path) == {"seed": 7, "sigmas": {"pixel_px": 0.3}}
    with pytest.raises(DatasetError):
        read_truth_extra(tmp_path / "nowhere")


@pytest.mark.parametrize(("text", "got"), [("- 1\n", "a list"), ("schema: other\n", "'other'"), ("5\n", "5")])
def test_other_schema_is_refused(tmp_path: Path, text: str, got: str) -> None:
    """The error for a list, a number or another schema states what was found."""
    (tmp_path / "truth.yaml").write_text(text)
    with pytest.raises(DatasetError, match=f"expected .*basecal/truth/1.*, got {got}"):
        read_truth(tmp_path)
