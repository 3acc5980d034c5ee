"""Tests of the recorded versions of software."""

from __future__ import annotations

import platform

import numpy as np

from basecal.cell.results.versions import used_versions


def test_versions_are_those_of_this_process():
    """Python's and NumPy's versions are those of this process; programs that are not installed are left out."""
    found = used_versions()
    assert found["python"] == platform.python_version()
    assert found["numpy"] == np.__version__
    assert all(found.values())
