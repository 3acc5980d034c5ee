"""What a cell says of a robot that answers OPC UA."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.acquisition.opcua.options import OpcuaOptions

URL = "opc.tcp://10.0.0.2"


def test_host_and_port_stand_in_the_address():
    """The port is that of OPC UA where none is said."""
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
def test_what_does_not_go_together_is_refused(wrong):
    """Another protocol, joints and a pose at once, a pose without its notation, an unknown unit."""
    with pytest.raises(ValidationError):
        OpcuaOptions(**wrong)
