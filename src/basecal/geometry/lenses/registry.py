"""Every lens: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise

from basecal.errors import InputError, nearest
from basecal.geometry.lens import Lens
from basecal.geometry.lenses import fisheye, pinhole, thin_prism

LENSES: Mapping[str, Lens] = {
    "pinhole": pinhole,
    "fisheye": fisheye,
    "thin_prism": thin_prism,
}
"""By name, the usual one of a model first; several may be one model with other numbers of terms."""


@cache
def find_lens(model: str, terms: int) -> Lens:
    """The lens of a model with so many distortion terms.

    Raises:
        InputError: if there is no such model, or none with so many terms.
    """
    for lens in model_lenses(model):
        if terms in lens.TERMS:
            return lens
    raise InputError(f"a {model} lens has {' or '.join(map(str, term_counts(model)))} distortion terms, not {terms}")


@cache
def model_lenses(model: str) -> tuple[Lens, ...]:
    """The lenses of a model, the usual one first.

    Raises:
        InputError: if there is no such model.
    """
    found = tuple(lens for lens in LENSES.values() if model == lens.MODEL)
    if not found:
        known = lens_models()
        raise InputError(f"no lens model {model!r}{nearest(model, known)}; there are: {', '.join(known)}")
    return found


@cache
def lens_models() -> tuple[str, ...]:
    """Names of the models there are."""
    return tuple(dict.fromkeys(lens.MODEL for lens in LENSES.values()))


@cache
def term_counts(model: str) -> tuple[int, ...]:
    """How many distortion terms a lens of the model may have, rising."""
    return tuple(sorted({count for lens in model_lenses(model) for count in lens.TERMS}))


def terms_text(model: str) -> str:
    """The distortion terms of a model, those that may be left out in brackets: `k1 k2 p1 p2 [k3 [k4 k5 k6]]`."""
    names = max((lens.TERM_NAMES for lens in model_lenses(model)), key=len)
    text = ""
    for start, end in reversed(list(pairwise([0, *filter(None, term_counts(model))]))):
        text = " ".join(names[start:end]) + (f" [{text}]" if text else "")
    return text
