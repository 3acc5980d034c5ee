"""Versions of the programs that an answer rests on."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("basecal", "numpy", "scipy", "opencv-python-headless")


def used_versions() -> dict[str, str]:
    """The versions of this program, of Python and of what it computes with, by name; what is not installed is not."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def program_version() -> str:
    """The version of this program; `unknown` where it is not installed."""
    return used_versions().get("basecal", "unknown")
