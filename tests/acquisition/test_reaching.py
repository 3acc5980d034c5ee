"""Tests of the addresses that drivers state before they are opened."""

from __future__ import annotations

import pytest

from basecal.acquisition.driver import DriverKind, Place, Secret
from basecal.acquisition.drivers.registry import DRIVERS, driver_kind
from basecal.acquisition.reaching import external_resources, missing_secrets
from basecal.cell import Cell, Robot

CELL = Cell("eye", {"eye": Robot("eye")})


@pytest.mark.parametrize("kind", DRIVERS)
def test_each_driver_states_its_addresses(kind):
    """Drivers of this package are called with all options, as foreign ones are."""
    assert driver_kind(kind).reaches is not None


def test_foreign_driver_is_listed_with_its_options(tmp_path):
    """A driver without `reaches` may connect to any address; local access and duplicates are not listed."""
    place = Place("eye", CELL, tmp_path, {"host": "10.0.0.9"})
    silent, inside = DriverKind(), DriverKind(reaches=lambda place: "")
    found = external_resources([(silent, place), (inside, place), (silent, place)])
    assert found == ["any resource that the driver of 'eye' accesses with host: 10.0.0.9"]


def test_missing_secrets_are_requested(tmp_path, monkeypatch):
    """An existing variable, even an empty one, is not requested."""
    kind = DriverKind(secret=lambda place: Secret("BASECAL_X", "me"))
    place = Place("eye", CELL, tmp_path)
    monkeypatch.delenv("BASECAL_X", raising=False)
    assert missing_secrets([(kind, place), (DriverKind(), place)]) == [Secret("BASECAL_X", "me")]
    monkeypatch.setenv("BASECAL_X", "")
    assert missing_secrets([(kind, place)]) == []
