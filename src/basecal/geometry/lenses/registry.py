"""Registry of lens models; to add one, add a module and a line here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise

from basecal.errors import InputError, spelling_hint
from basecal.geometry.lens import Lens
from basecal.geometry.lenses import fisheye, pinhole, thin_prism

LENSES: Mapping[str, Lens] = {
    "pinhole": pinhole,
    "fisheye": fisheye,
    "thin_prism": thin_prism,
}
"""Lenses by name. Lenses of one model differ in their numbers of terms; the default lens of a model is first."""


@cache
def find_lens(model: str, terms: int) -> Lens:
    """Find the lens of a model with a number of distortion terms.

    Raises:
        InputError: if the model does not exist, or has no such number of terms.
    """
    for lens in model_lenses(model):
        if terms in lens.TERMS:
            return lens
    raise InputError(f"a {model} lens has {' or '.join(map(str, term_counts(model)))} distortion terms, not {terms}")


@cache
def model_lenses(model: str) -> tuple[Lens, ...]:
    """Lenses of a model, the default one first.

    Raises:
        InputError: if the model does not exist.
    """
    found = tuple(lens for lens in LENSES.values() if model == lens.MODEL)
    if not found:
        known = lens_models()
        raise InputError(f"no lens model {model!r}{spelling_hint(model, known)}; there are: {', '.join(known)}")
    return found


@cache
def lens_models() -> tuple[str, ...]:
    """Names of all lens models."""
    return tuple(dict.fromkeys(lens.MODEL for lens in LENSES.values()))


@cache
def term_counts(model: str) -> tuple[int, ...]:
    """Valid numbers of distortion terms of a model, increasing."""
    return tuple(sorted({count for lens in model_lenses(model) for count in lens.TERMS}))


def terms_text(model: str) -> str:
    """Distortion terms of a model as text, with optional terms in brackets: `k1 k2 p1 p2 [k3 [k4 k5 k6]]`."""
    names = max((lens.TERM_NAMES for lens in model_lenses(model)), key=len)
    text = ""
    for start, end in reversed(list(pairwise([0, *filter(None, term_counts(model))]))):
        text = " ".join(names[start:end]) + (f" [{text}]" if text else "")
    return text
