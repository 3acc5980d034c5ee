"""A robot that answers OPC UA: its process takes seconds to start, and is one for all tests."""

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
    """The robot, as it began."""
    _opcua_process.tell("reset")
    return _opcua_process
