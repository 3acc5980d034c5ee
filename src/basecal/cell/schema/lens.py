"""Lens entries of cameras in `cell.yaml`."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.fields.values import Entry, Number, Pixels, Sigma2, Sigmas, Status
from basecal.geometry.lenses.registry import model_lenses, term_counts

_FOCAL_WIDTHS = (0.05, 50.0)  # in image widths: from half that of a fisheye to beyond the longest telephoto lens
_CENTRE_WIDTHS = 2.0  # in image widths from the image centre: more than any shift lens or cropped image has
_USUAL_WIDTHS = (16, 100_000)  # [px] if the image size is not stated


class IntrinsicsEntry(Entry):
    """A lens."""

    status: Status
    fx: Pixels | None = None
    fy: Pixels | None = None
    cx: Number | None = None
    cy: Number | None = None
    distortion: list[Number] | None = None
    distortion_terms: int | None = None
    sigma_focal_px: Sigma2 | None = None
    sigma_center_px: Sigma2 | None = None
    sigma_distortion: Sigmas | None = None
    exact: bool = False


def distortion_terms(entry: IntrinsicsEntry, model: str) -> int:
    """Number of distortion coefficients of the lens, stated or to be estimated."""
    if entry.distortion is not None:
        return len(entry.distortion)
    if entry.status != "free":
        return 0
    return model_lenses(model)[0].USUAL_TERMS if entry.distortion_terms is None else entry.distortion_terms


def check_lens(entry: IntrinsicsEntry, model: str) -> None:
    """Check that the entry is consistent with its status and the lens model.

    Raises:
        ValueError: if it is not.
    """
    missing = [name for name in ("fx", "fy", "cx", "cy") if getattr(entry, name) is None]
    if entry.status != "free" and missing:
        raise ValueError(f"status {entry.status} needs {', '.join(missing)}")
    if entry.status == "free" and len(missing) not in (0, 4):
        raise ValueError(f"a guess needs all of fx, fy, cx, cy; missing {', '.join(missing)}")
    if len(missing) == 4 and entry.distortion is not None:
        raise ValueError("distortion needs fx, fy, cx, cy beside it")
    if entry.distortion_terms is not None and entry.status != "free":
        raise ValueError(f"distortion_terms is for status free; if {entry.status}, distortion itself has that length")
    terms, possible = distortion_terms(entry, model), term_counts(model)
    if terms not in possible or entry.distortion_terms not in (None, terms):
        allowed = " or ".join(map(str, possible))
        raise ValueError(f"distortion of a {model} camera has {allowed} terms (distortion_terms too), got {terms}")
    if entry.exact and entry.status != "fixed":
        raise ValueError(f"exact is for status fixed, not {entry.status}")
    stated = {name for name in IntrinsicsEntry.model_fields if "sigma" in name and getattr(entry, name) is not None}
    required = {"sigma_focal_px", "sigma_center_px", *(["sigma_distortion"] if terms else [])}
    required = required if entry.status == "prior" else set()
    if stated != required:
        raise ValueError(f"status {entry.status} takes {', '.join(sorted(required)) or 'no sigma'}")
    if entry.sigma_distortion is not None and len(entry.sigma_distortion) not in (1, terms):
        raise ValueError(f"sigma_distortion has {len(entry.sigma_distortion)} numbers, expected 1 or {terms}")


def check_size(entry: IntrinsicsEntry, size_px: Sequence[int] | None) -> None:
    """Check that focal lengths and centre are plausible for an image of this size.

    Raises:
        ValueError: if they are not.
    """
    if entry.fx is None or entry.fy is None or entry.cx is None or entry.cy is None:
        return
    widths = _USUAL_WIDTHS if size_px is None else (size_px[0], size_px[0])
    low, high = _FOCAL_WIDTHS[0] * widths[0], _FOCAL_WIDTHS[1] * widths[1]
    image = "any image" if size_px is None else f"an image {size_px[0]} px wide"
    for name, focal in (("fx", entry.fx), ("fy", entry.fy)):
        if not low <= focal <= high:
            raise ValueError(f"{name} is {focal:g} px: lenses of {image} have between {low:g} and {high:g} px")
    middles = (0.0, 0.0) if size_px is None else ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2)
    far = _CENTRE_WIDTHS * widths[1]
    for name, centre, middle in (("cx", entry.cx, middles[0]), ("cy", entry.cy, middles[1])):
        if abs(centre - middle) > far:
            raise ValueError(f"{name} is {centre:g} px: the centre of {image} lies within {far:g} px of {middle:g}")
