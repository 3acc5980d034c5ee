"""Drivers by their names."""

from __future__ import annotations

from types import ModuleType

import pytest

from basecal.acquisition.drivers.registry import DRIVERS, driver_kind, driver_names, offered_driver
from safety.installed_driver import installed_driver
from shared.second_process import TESTS


def test_a_driver_of_another_package_is_found_as_pip_installs_it(tmp_path):
    """Its name comes after ours, its module declares what stops its arms, and it runs in a process of its own."""
    assert driver_kind("frail") is None
    with installed_driver(tmp_path, "frail", TESTS / "safety" / "frail_driver.py"):
        assert driver_names() == (*DRIVERS, "frail")
        kind = driver_kind("frail")
        assert (kind.stop_guarantee, kind.needs_own_process) == ("watchdog", True)
        assert kind.open_camera is None


def test_a_module_that_declares_nothing_is_trusted_with_nothing():
    """Nothing stops its arms, and it gets a process of its own."""
    kind = offered_driver(ModuleType("stranger"))
    assert (kind.open_robot, kind.open_camera, kind.stop_guarantee, kind.needs_own_process) == (
        None,
        None,
        "none",
        True,
    )


@pytest.mark.parametrize("name", DRIVERS)
def test_ours_open_robots_or_cameras(name):
    """Those that ask a person or simulate need no process of their own, and two are stopped by a watchdog."""
    kind = driver_kind(name)
    assert kind.open_robot or kind.open_camera
    assert kind.needs_own_process == (name not in ("simulated", "replay", "typed"))
    assert kind.stop_guarantee == ("watchdog" if name in ("simulated", "ur") else "none")
