"""Exporters are found by their registered names."""

from __future__ import annotations

import pytest

from basecal import registry
from basecal.exchange.exporters.exporter import exporter


@pytest.mark.parametrize("name", registry.EXPORTERS)
def test_every_registered_exporter_exports(name):
    """Each is a module with the function that gives a file's text."""
    assert callable(exporter(name).exported)
