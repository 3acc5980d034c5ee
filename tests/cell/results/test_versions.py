"""Versions of what was used."""

from __future__ import annotations

import platform

import numpy as np

from basecal.cell.results.versions import used_versions


def test_versions_are_those_that_run():
    """Python's and NumPy's are the ones of this process; a program that is not installed is not named."""
    found = used_versions()
    assert found["python"] == platform.python_version()
    assert found["numpy"] == np.__version__
    assert all(found.values())
