"""The lens of a camera as `cell.yaml` may hold it."""

from __future__ import annotations

from basecal.cell.format.values import Entry, Length, Number, Sigma2, Sigmas, Status
from basecal.geometry.lens import lenses_of, term_counts


class IntrinsicsEntry(Entry):
    """A lens."""

    status: Status
    fx: Length | None = None
    fy: Length | None = None
    cx: Number | None = None
    cy: Number | None = None
    distortion: list[Number] | None = None
    distortion_terms: int | None = None
    sigma_focal_px: Sigma2 | None = None
    sigma_center_px: Sigma2 | None = None
    sigma_distortion: Sigmas | None = None


def distortion_terms(entry: IntrinsicsEntry, model: str) -> int:
    """How many distortion coefficients the lens has or is to have."""
    if entry.distortion is not None:
        return len(entry.distortion)
    if entry.status != "free":
        return 0
    return lenses_of(model)[0].USUAL_TERMS if entry.distortion_terms is None else entry.distortion_terms


def check_lens(entry: IntrinsicsEntry, model: str) -> None:
    """Nothing, when what is written suits the status and the model.

    Raises:
        ValueError: if not.
    """
    missing = [name for name in ("fx", "fy", "cx", "cy") if getattr(entry, name) is None]
    if entry.status != "free" and missing:
        raise ValueError(f"status {entry.status} needs {', '.join(missing)}")
    if entry.status == "free" and len(missing) not in (0, 4):
        raise ValueError(f"a guess needs all of fx, fy, cx, cy; missing {', '.join(missing)}")
    if len(missing) == 4 and entry.distortion is not None:
        raise ValueError("distortion needs fx, fy, cx, cy beside it")
    if entry.distortion_terms is not None and entry.status != "free":
        raise ValueError(f"distortion_terms is for status free; with {entry.status} the length of distortion tells it")
    terms, known = distortion_terms(entry, model), term_counts(model)
    if terms not in known or entry.distortion_terms not in (None, terms):
        allowed = " or ".join(map(str, known))
        raise ValueError(f"distortion of a {model} camera has {allowed} terms (distortion_terms alike), got {terms}")
    given = {name for name in IntrinsicsEntry.model_fields if "sigma" in name and getattr(entry, name) is not None}
    wanted = {"sigma_focal_px", "sigma_center_px", *(["sigma_distortion"] if terms else [])}
    wanted = wanted if entry.status == "prior" else set()
    if given != wanted:
        raise ValueError(f"status {entry.status} takes {', '.join(sorted(wanted)) or 'no sigma'}")
    if entry.sigma_distortion is not None and len(entry.sigma_distortion) not in (1, terms):
        raise ValueError(f"sigma_distortion has {len(entry.sigma_distortion)} numbers, expected 1 or {terms}")
