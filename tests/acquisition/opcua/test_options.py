"""Tests of the options of an OPC UA robot."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.acquisition.opcua.options import OpcuaOptions

URL = "opc.tcp://10.0.0.2"


def test_host_and_port_come_from_the_address():
    """The default port is that of OPC UA."""
    near, far = OpcuaOptions(url=URL), OpcuaOptions(url="opc.tcp://robot.local:48010/some/path")
    assert (near.host, near.port, far.host, far.port) == ("10.0.0.2", 4840, "robot.local", 48010)


@pytest.mark.parametrize(
    "wrong",
    [
        {"url": "http://10.0.0.2"},
        {"url": URL, "joints": ["a"], "pose": "b", "notation": "kuka"},
        {"url": URL, "pose": "b"},
        {"url": URL, "notation": "kuka"},
        {"url": URL, "unit": "grad"},
    ],
)
def test_contradictory_options_are_refused(wrong):
    """Another protocol, joints with a pose, a pose without its convention, and an unknown unit are refused."""
    with pytest.raises(ValidationError):
        OpcuaOptions(**wrong)
