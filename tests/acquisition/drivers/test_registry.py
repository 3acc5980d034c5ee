"""Tests of the registry of drivers."""

from __future__ import annotations

from types import ModuleType

import pytest

from basecal.acquisition.drivers.registry import DRIVERS, driver_kind, driver_names, offered_driver
from safety.installed_driver import installed_driver
from shared.second_process import TESTS


def test_driver_of_an_installed_package_is_found(tmp_path):
    """It is listed after the own drivers, its module declares its stop guarantee, and it has its own process."""
    assert driver_kind("frail") is None
    with installed_driver(tmp_path, "frail", TESTS / "safety" / "frail_driver.py"):
        assert driver_names() == (*DRIVERS, "frail")
        kind = driver_kind("frail")
        assert (kind.stop_guarantee, kind.needs_own_process) == ("watchdog", True)
        assert kind.open_camera is None


def test_module_without_declarations_is_not_trusted():
    """It has no stop guarantee, and gets its own process."""
    kind = offered_driver(ModuleType("stranger"))
    assert (kind.open_robot, kind.open_camera, kind.stop_guarantee, kind.needs_own_process) == (
        None,
        None,
        "none",
        True,
    )


@pytest.mark.parametrize("name", DRIVERS)
def test_own_drivers_open_robots_or_cameras(name):
    """Typed and simulated drivers need no own process, and two drivers have a watchdog."""
    kind = driver_kind(name)
    assert kind.open_robot or kind.open_camera
    assert kind.needs_own_process == (name not in ("simulated", "replay", "typed"))
    assert kind.stop_guarantee == ("watchdog" if name in ("simulated", "ur") else "none")
