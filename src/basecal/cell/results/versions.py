"""Versions of the programs used in a calibration."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("basecal", "numpy", "scipy", "opencv-python-headless")


def used_versions() -> dict[str, str]:
    """Versions of basecal, Python and the numerical packages by name; packages not installed are left out."""
    versions = {package: _version(package) for package in _PACKAGES}
    return {"python": platform.python_version()} | {name: v for name, v in versions.items() if v is not None}


@cache
def _version(package: str) -> str | None:
    """Version of a package; None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def program_version() -> str:
    """Version of basecal; `unknown` if it is not installed as a package."""
    return _version("basecal") or "unknown"
