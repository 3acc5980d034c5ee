"""Types of options that several verbs take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators


def number_range(low: float, high: float) -> Parameter:
    """A number between two others, these included."""
    return Parameter(validator=validators.Number(gte=low, lte=high))


Seed = Annotated[int, number_range(0, 2**63 - 1)]
Port = Annotated[int, number_range(0, 2**16 - 1)]
Domain = Annotated[int | None, number_range(0, 232)]
Output = Annotated[Path | None, Parameter(alias="-o")]
OpensPage = Annotated[bool, Parameter(name="--open")]
Names = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]
