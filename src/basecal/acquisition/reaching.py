"""Resources outside a cell's folder that drivers access, listed before any driver is opened.

A driver describes them by `reaches(place)`; a driver without that function is listed with all its options.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from basecal.acquisition.driver import DriverKind, Place, Secret

SECRET_VARIABLE_PATTERN = r"^BASECAL_[A-Z0-9_]+$"
"""Pattern of the names of environment variables that may hold a secret; no other variables are read."""


def external_resources(openers: Iterable[tuple[DriverKind, Place]]) -> list[str]:
    """Resources outside the cell's folder that drivers access, one line each.

    Raises:
        DatasetError: if an option is wrong.
    """
    descriptions = [
        _describe_options(place) if kind.reaches is None else kind.reaches(place) for kind, place in openers
    ]
    return [line for line in dict.fromkeys(descriptions) if line]


def missing_secrets(openers: Iterable[tuple[DriverKind, Place]]) -> list[Secret]:
    """Secrets for drivers' logins that are not set in the environment."""
    secrets = [kind.secret(place) for kind, place in openers if kind.secret is not None]
    return [secret for secret in secrets if secret is not None and secret.variable not in os.environ]


def _describe_options(place: Place) -> str:
    options = ", ".join(f"{key}: {value}" for key, value in place.options.items())
    return f"any resource that the driver of {place.name!r} accesses with {options or 'no options'}"


def describe_external_path(folder: Path, path: Path, noun: str) -> str:
    """Description of a path outside a folder; empty if the path, with symbolic links resolved, is inside."""
    is_inside = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
    return "" if is_inside else f"the {noun} {path}"
