"""Tests of finding lenses, and of properties of every lens."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import Camera
from basecal.geometry.lenses import fisheye, pinhole, thin_prism
from basecal.geometry.lenses.registry import LENSES, find_lens, lens_models, model_lenses, term_counts, terms_text

DOCUMENT = Path(__file__).parents[3] / "docs" / "data_format.md"


@pytest.mark.parametrize("model", lens_models())
def test_every_number_of_terms_has_one_lens(model: str) -> None:
    """No two lenses of a model have the same number of terms, and each names its largest number of terms."""
    counts = [count for lens in model_lenses(model) for count in lens.TERMS]
    assert sorted(counts) == list(term_counts(model))
    assert all(max(lens.TERMS) == len(lens.TERM_NAMES) for lens in model_lenses(model))
    assert all(lens.USUAL_TERMS in lens.TERMS for lens in model_lenses(model))


@pytest.mark.parametrize("model", lens_models())
def test_usual_lens_covers_its_image(model: str) -> None:
    """Nearly every pixel of simulated lenses has a direction that projects to the pixel."""
    for seed, lens in enumerate(model_lenses(model)):
        rng = np.random.default_rng(seed)
        distortion = lens.usual_distortion(rng)
        assert len(distortion) == lens.USUAL_TERMS
        for focal in lens.USUAL_FOCAL_PX:
            camera = Camera(model, np.array([focal, focal, 639.5, 359.5, *distortion]), (1280, 720))
            pixels = np.stack(np.meshgrid(np.arange(0, 1280, 64.0), np.arange(0, 720, 48.0)), -1)
            rays, valid = camera.undistort(pixels)
            assert valid.mean() > 0.95
            np.testing.assert_allclose(camera.project(rays[valid]), pixels[valid], rtol=0, atol=1e-8)
            assert lens.domain_mask(rays[valid], distortion.tolist()).all()
            (left, right), _ = camera.undistort(np.array([[0.0, 359.5], [1279.0, 359.5]]))
            assert 60 < np.degrees(np.arccos(left @ right)) < 170  # a field of view of commercial lenses


def test_terms_are_documented() -> None:
    """A row of the table of lenses in docs/data_format.md has each model's numbers of terms and their names."""
    text = DOCUMENT.read_text(encoding="utf-8").partition("| `model` |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \|", text, re.MULTILINE)
    stated = [
        (model, ", ".join(map(str, term_counts(model))), f"`{terms_text(model)}`" if terms_text(model) else "none")
        for model in lens_models()
    ]
    assert rows == stated, (
        f"docs/data_format.md: the table of lenses has a row | `MODEL` | terms | names | for: {stated}"
    )


def test_terms_text_brackets_optional_terms() -> None:
    """Optional distortion terms are in nested brackets."""
    assert terms_text("fisheye") == "k1 k2 k3 k4"
    assert terms_text("pinhole").startswith("k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4")
    assert terms_text("pinhole").endswith("]" * (len(term_counts("pinhole")) - 2))


def test_unknown_lens_is_refused() -> None:
    """The error about an unknown model or number of terms lists the available ones."""
    with pytest.raises(InputError, match="did you mean 'fisheye'"):
        find_lens("fisheyes", 4)
    with pytest.raises(InputError, match="4 distortion terms, not 5"):
        find_lens("fisheye", 5)
    with pytest.raises(InputError, match="a pinhole lens has 0 or 4 or 5 or 8"):
        find_lens("pinhole", 6)


def test_lens_by_model_and_terms() -> None:
    """A lens is found by its model and number of terms, and the default lens of a model is the first."""
    assert [find_lens("pinhole", terms) for terms in (0, 4, 5, 8, 12)] == [pinhole] * 4 + [thin_prism]
    assert find_lens("fisheye", 4) is fisheye
    assert model_lenses("pinhole") == (pinhole, thin_prism)
    assert model_lenses("fisheye") == (fisheye,)
    assert lens_models()[0] == "pinhole"
    assert sorted(lens_models()) == sorted({lens.MODEL for lens in LENSES.values()})
    assert term_counts("fisheye") == (4,)
    assert term_counts("pinhole")[:5] == (0, 4, 5, 8, 12)
