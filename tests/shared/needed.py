"""What the tests of a module need, looked for without importing it: collecting takes every worker as long."""

from __future__ import annotations

from importlib.util import find_spec

import pytest


def needed(package: str, extra: str) -> None:
    """Skip the module that says so where a package of an extra is not installed."""
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed: pip install 'basecal[{extra}]'", allow_module_level=True)
