"""Tests of the validity of lens entries."""

from __future__ import annotations

import pytest

from basecal.cell.schema.lens import IntrinsicsEntry, check_lens, check_size, distortion_terms

KNOWN = {"fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
SIGMAS = {"sigma_focal_px": 1.0, "sigma_center_px": [1.0, 2.0]}


def entry(status, **fields):
    return IntrinsicsEntry.model_validate({"status": status, **fields})


@pytest.mark.parametrize(
    ("written", "model", "terms"),
    [
        (entry("fixed", **KNOWN), "pinhole", 0),
        (entry("fixed", **KNOWN, distortion=[0.1] * 8), "pinhole", 8),
        (entry("fixed", **KNOWN, distortion=[0.1] * 4), "fisheye", 4),
        (entry("prior", **KNOWN, **SIGMAS), "pinhole", 0),
        (entry("prior", **KNOWN, distortion=[0.1] * 5, **SIGMAS, sigma_distortion=0.1), "pinhole", 5),
        (entry("prior", **KNOWN, distortion=[0.1] * 5, **SIGMAS, sigma_distortion=[0.1] * 5), "pinhole", 5),
        (entry("fixed", **KNOWN, exact=True), "pinhole", 0),
        (entry("free"), "pinhole", 5),
        (entry("free"), "fisheye", 4),
        (entry("free", distortion_terms=0), "pinhole", 0),
        (entry("free", **KNOWN, distortion_terms=8), "pinhole", 8),
        (entry("free", **KNOWN, distortion=[0.1] * 4, distortion_terms=4), "pinhole", 4),
    ],
)
def test_valid_lenses_have_expected_term_count(written, model, terms):
    """Fixed, prior and free lenses are accepted with any term count that their model allows."""
    check_lens(written, model)
    assert distortion_terms(written, model) == terms


@pytest.mark.parametrize(
    ("written", "model", "message"),
    [
        (entry("fixed", fx=1.0), "pinhole", "status fixed needs fy, cx, cy"),
        (entry("free", exact=True), "pinhole", "exact is for status fixed, not free"),
        (entry("free", fx=1.0), "pinhole", "a guess needs all of fx, fy, cx, cy; missing fy, cx, cy"),
        (entry("free", distortion=[0.1] * 5), "pinhole", "distortion needs fx, fy, cx, cy beside it"),
        (entry("fixed", **KNOWN, distortion_terms=0), "pinhole", "distortion_terms is for status free; if fixed"),
        (entry("fixed", **KNOWN, distortion=[0.1] * 3), "pinhole", "has 0 or 4 or 5 or 8 or 12 terms .*, got 3"),
        (entry("fixed", **KNOWN), "fisheye", "a fisheye camera has 4 terms .*, got 0"),
        (entry("free", **KNOWN, distortion=[0.1] * 4, distortion_terms=5), "pinhole", "got 4"),
        (entry("fixed", **KNOWN, **SIGMAS), "pinhole", "status fixed takes no sigma"),
        (entry("prior", **KNOWN), "pinhole", "status prior takes sigma_center_px, sigma_focal_px$"),
        (entry("prior", **KNOWN, **SIGMAS, sigma_distortion=1.0), "pinhole", "takes sigma_center_px, sigma_focal_px$"),
        (entry("prior", **KNOWN, distortion=[0.1] * 5, **SIGMAS), "pinhole", "sigma_distortion, sigma_focal_px"),
        (
            entry("prior", **KNOWN, distortion=[0.1] * 5, **SIGMAS, sigma_distortion=[1.0] * 4),
            "pinhole",
            "sigma_distortion has 4 numbers, expected 1 or 5",
        ),
    ],
)
def test_invalid_lens_entries_are_refused(written, model, message):
    """The error names missing and surplus fields."""
    with pytest.raises(ValueError, match=message):
        check_lens(written, model)


@pytest.mark.parametrize("size_px", [(640, 480), (480, 640), (4000, 4000), None])
def test_lens_fits_image_size(size_px):
    """A lens is accepted for its image, also for one in portrait orientation or of unstated size."""
    check_size(entry("fixed", **KNOWN), size_px)
    check_size(entry("free"), size_px)


@pytest.mark.parametrize(
    ("change", "size_px", "message"),
    [
        (
            {"fx": 1e-320},
            (640, 480),
            "fx is 9.99989e-321 px: lenses of an image 640 px wide have between 32 and",
        ),
        ({"fy": 0.013}, (640, 480), "fy is 0.013 px"),
        ({"fy": 0.013}, None, "fy is 0.013 px: lenses of any image have between 0.8 and 5e"),
        ({"fx": 33000.0}, (640, 480), "fx is 33000 px"),
        (
            {"cy": 348268.09},
            (640, 480),
            "cy is 348268 px: the centre of an image 640 px wide lies within",
        ),
        ({"cx": -961.0}, (640, 480), "cx is -961 px"),
        ({"cx": -2e5 - 1}, None, "cx is -200001 px"),
    ],
)
def test_implausible_lens_values_are_refused(change, size_px, message):
    """The error for an implausible focal length or centre states the plausible range for the image."""
    with pytest.raises(ValueError, match=message):
        check_size(entry("fixed", **{**KNOWN, **change}), size_px)
