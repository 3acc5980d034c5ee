"""What drivers reach, stated before they are opened."""

from __future__ import annotations

import pytest

from basecal.acquisition.driver import DriverKind, Place, Secret
from basecal.acquisition.drivers.registry import DRIVERS, driver_kind
from basecal.acquisition.reaching import external_resources, missing_secrets
from basecal.cell import Cell, Robot

CELL = Cell("eye", {"eye": Robot("eye")})


@pytest.mark.parametrize("kind", DRIVERS)
def test_each_driver_states_what_it_reaches(kind):
    """None of ours is asked with all its options, as those of others are."""
    assert driver_kind(kind).reaches is not None


def test_a_driver_of_others_is_stated_with_its_options(tmp_path):
    """One without `reaches` may reach anything; what stays inside is not stated, and nothing twice."""
    place = Place("eye", CELL, tmp_path, {"host": "10.0.0.9"})
    silent, inside = DriverKind(), DriverKind(reaches=lambda place: "")
    found = external_resources([(silent, place), (inside, place), (silent, place)])
    assert found == ["any resource that the driver of 'eye' accesses with host: 10.0.0.9"]


def test_secrets_are_needed_if_the_environment_lacks_them(tmp_path, monkeypatch):
    """A variable that is there, also an empty one, is not asked for."""
    kind = DriverKind(secret=lambda place: Secret("BASECAL_X", "me"))
    place = Place("eye", CELL, tmp_path)
    monkeypatch.delenv("BASECAL_X", raising=False)
    assert missing_secrets([(kind, place), (DriverKind(), place)]) == [Secret("BASECAL_X", "me")]
    monkeypatch.setenv("BASECAL_X", "")
    assert missing_secrets([(kind, place)]) == []
