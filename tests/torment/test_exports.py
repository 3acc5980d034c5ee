"""Hostile names in every kind of export, read back by parsers that are not ours."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from basecal.exchange.exporters.registry import EXPORTERS
from torment.exports import EXPORTS, PARSERS


def test_every_exporter_has_a_parser() -> None:
    """A new exporter is tormented too."""
    assert PARSERS.keys() == EXPORTERS.keys()


@pytest.mark.parametrize("name", EXPORTS)
def test_hostile_names_stay_names(name: str, tmp_path: Path) -> None:
    """Whatever names and hashes hold, a reader of the format finds what it finds of harmless ones."""
    came = {EXPORTS[name](Random(f"{name} {seed}"), tmp_path) for seed in range(40)}
    assert came == {"answered"}
