"""Versions of the programs used in a calibration."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("basecal", "numpy", "scipy", "opencv-python-headless")


def used_versions() -> dict[str, str]:
    """Versions of basecal, Python and the numerical packages by name; packages not installed are left out."""
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions


def program_version() -> str:
    """Version of basecal; `unknown` if it is not installed as a package."""
    return used_versions().get("basecal", "unknown")
