"""Tests of hostile names in each kind of export, read by independent parsers."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from basecal.exchange.exporters.registry import EXPORTERS
from torment.exports import EXPORTS, PARSERS


def test_every_exporter_has_a_parser() -> None:
    """A new exporter needs a trial, too."""
    bare, unknown = sorted(EXPORTERS.keys() - PARSERS.keys()), sorted(PARSERS.keys() - EXPORTERS.keys())
    assert not bare, f"add to PARSERS in tests/torment/exports.py a reader that is not ours: {', '.join(bare)}"
    assert not unknown, f"remove from PARSERS in tests/torment/exports.py: {', '.join(unknown)}"


@pytest.mark.parametrize("name", EXPORTS)
def test_hostile_names_stay_names(name: str, tmp_path: Path) -> None:
    """With any names and hashes, a reader of the format finds the same elements as with harmless ones."""
    came = {EXPORTS[name](Random(f"{name} {seed}"), tmp_path) for seed in range(40)}
    assert came == {"answered"}
