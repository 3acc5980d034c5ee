"""Requirements of test modules, checked without importing packages: collection by every worker would take as long."""

from __future__ import annotations

from importlib.util import find_spec

import pytest


def needed(package: str, extra: str) -> None:
    """Skip the calling module if a package of an extra is not installed."""
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed: pip install 'basecal[{extra}]'", allow_module_level=True)
