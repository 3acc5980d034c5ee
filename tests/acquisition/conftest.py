"""Fixtures of processes that speak robots' protocols; they take seconds to start and serve many tests."""

from __future__ import annotations

import pytest

from shared import opcua_place


@pytest.fixture(scope="session")
def _opcua_process():
    pytest.importorskip("asyncua")
    with opcua_place.opcua_robot() as robot:
        yield robot


@pytest.fixture
def opcua_robot(_opcua_process):
    """OPC UA robot in its initial state."""
    _opcua_process.tell("reset")
    return _opcua_process


@pytest.fixture(scope="session")
def _ros2_process():
    pytest.importorskip("cyclonedds")
    from shared.ros2_domain import ros2, watching

    with ros2(cell=watching(None)) as process:
        yield process


@pytest.fixture
def ros2_cell(_ros2_process):
    """Senders of ROS 2: 100 joint states and 30 small images a second, and tf; silent between tests."""
    for words in (("rate", "joints", 100), ("rate", "images", 30), ("freeze", "off"), ("partial", "off")):
        _ros2_process.tell(*words)
    yield _ros2_process
    for of in ("joints", "images"):
        _ros2_process.tell("rate", of, 0)


@pytest.fixture(scope="module")
def _switched_on():
    from shared.ur_place import controller

    with controller() as there:
        yield there


@pytest.fixture
def there(_switched_on):
    """UR controller as after power-on, and the place of its robot."""
    _switched_on[0].tell("reset")
    return _switched_on
