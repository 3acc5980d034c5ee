"""What may be written of a lens."""

from __future__ import annotations

import pytest

from basecal.cell.schema.lens import IntrinsicsEntry, check_lens, distortion_terms

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
        (entry("free"), "pinhole", 5),
        (entry("free"), "fisheye", 4),
        (entry("free", distortion_terms=0), "pinhole", 0),
        (entry("free", **KNOWN, distortion_terms=8), "pinhole", 8),
        (entry("free", **KNOWN, distortion=[0.1] * 4, distortion_terms=4), "pinhole", 4),
    ],
)
def test_lenses_that_suit(written, model, terms):
    """Known, roughly known and unknown ones, with as many terms as the model may have."""
    check_lens(written, model)
    assert distortion_terms(written, model) == terms


@pytest.mark.parametrize(
    ("written", "model", "message"),
    [
        (entry("fixed", fx=1.0), "pinhole", "status fixed needs fy, cx, cy"),
        (entry("free", fx=1.0), "pinhole", "a guess needs all of fx, fy, cx, cy; missing fy, cx, cy"),
        (entry("free", distortion=[0.1] * 5), "pinhole", "distortion needs fx, fy, cx, cy beside it"),
        (entry("fixed", **KNOWN, distortion_terms=0), "pinhole", "distortion_terms is for status free; with fixed"),
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
def test_lenses_that_do_not(written, model, message):
    """What is lacking or too much is named."""
    with pytest.raises(ValueError, match=message):
        check_lens(written, model)
