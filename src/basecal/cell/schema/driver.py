"""`driver:` of a robot or a camera: which program talks to it, and what that program has to know."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator

from basecal.fields.problems import shorten

_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")


def _with_kind(value: dict[str, Any]) -> dict[str, Any]:
    kind = value.get("kind")
    if not (isinstance(kind, str) and _NAME.fullmatch(kind)):
        raise ValueError(
            f"expected `kind`, the name of a driver (a-z, 0-9 and _), with its options beside it; got {shorten(kind)}"
        )
    return value


DriverEntry = Annotated[dict[str, Any], AfterValidator(_with_kind)]
"""The name of a driver as `kind`, and its options; the driver itself checks these when it is opened."""
