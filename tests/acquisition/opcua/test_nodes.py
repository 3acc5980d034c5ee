"""Tests of the search for a robot's joints on an OPC UA server."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from basecal.acquisition.opcua.nodes import axis_position_nodes, named_nodes, radians_per_unit
from basecal.errors import DriverError


class Node:
    """Node with children by name and a readable value."""

    def __init__(self, name, *children, value=None):
        self.name, self.children, self.value = name, children, value

    def read_browse_name(self):
        return SimpleNamespace(Name=self.name)

    def get_children(self):
        return self.children

    def read_value(self):
        return self.value

    def __str__(self):
        return self.name


def axis(name):
    return Node(name, Node("ParameterSet", Node("ActualPosition", value=name)))


def device(name, *axes):
    return Node(name, Node("Axes", *map(axis, axes)))


def client(*devices):
    """Server with a system of these devices."""
    system = Node("System", Node("MotionDevices", *devices), Node("Controllers"))
    objects = Node("Objects", Node("DeviceSet", system), Node("Server"))
    return SimpleNamespace(nodes=SimpleNamespace(objects=objects), get_node=lambda words: f"node {words}")


def found(*args):
    return [node.value for node in axis_position_nodes(*args)]


def test_axes_are_in_the_order_of_their_numbers():
    """A server may list the tenth before the second; without numbers its own order counts."""
    assert found(client(device("arm", "A10", "A2", "A1")), "eye", None) == ["A1", "A2", "A10"]
    assert found(client(device("arm", "Swing", "Lift")), "eye", None) == ["Swing", "Lift"]


def test_device_must_be_chosen_among_several():
    """Missing, unknown and absent names are reported with the existing devices."""
    several = client(device("left", "A1"), device("right", "B1"))
    assert found(several, "eye", "right") == ["B1"]
    with pytest.raises(DriverError, match="eye: `device` is not stated; there are: left, right"):
        found(several, "eye", None)
    with pytest.raises(DriverError, match="eye: no motion device 'middle'; there are: left, right"):
        found(several, "eye", "middle")
    with pytest.raises(DriverError, match=r"eye: no motion device; there are: none\. Name the device, or the nodes"):
        found(client(), "eye", None)


def test_axes_without_positions_are_an_error():
    """The error says what to state instead."""
    bare = Node("arm", Node("Axes", Node("A1", Node("ParameterSet"))))
    with pytest.raises(DriverError, match="eye: the axes of 'arm' have no ActualPosition; name the nodes"):
        found(client(bare), "eye", None)


def test_nodes_are_named_by_id_or_path():
    """An id is read directly; a path is followed, and if it ends too early its children are listed."""
    there = client(device("arm", "A1"))
    assert named_nodes(there, "eye", "ns=2;s=axis") == ["node ns=2;s=axis"]
    assert [node.name for node in named_nodes(there, "eye", ["DeviceSet/System", "Objects/Server"])] == [
        "System",
        "Server",
    ]
    with pytest.raises(DriverError, match="eye: no node 'Sytem' of 'DeviceSet/Sytem'; there are: System"):
        named_nodes(there, "eye", ["DeviceSet/Sytem"])


def said(unit, word=""):
    """Node that states its unit by code or name."""
    information = SimpleNamespace(UnitId=unit, DisplayName=SimpleNamespace(Text=word))
    return Node("A1", Node("EngineeringUnits", value=information))


@pytest.mark.parametrize(
    ("node", "stated", "radians"),
    [
        (said(17476), None, math.radians(1)),  # DD, degrees
        (said(4405297), None, 1.0),  # C81, radians
        (said(-1, "deg"), None, math.radians(1)),
        (said(-1, "turns"), "rad", 1.0),
        (Node("A1"), "deg", math.radians(1)),
        (said(17476), "deg", math.radians(1)),
    ],
)
def test_units_are_the_stated_ones(node, stated, radians):
    """The server's code or name counts, otherwise the cell's."""
    assert radians_per_unit(node, "eye", stated) == radians


def test_units_are_never_guessed():
    """Missing and contradictory units are errors."""
    with pytest.raises(DriverError, match="eye: A1 does not state its unit: state `unit: deg` or `unit: rad`"):
        radians_per_unit(Node("A1"), "eye", None)
    with pytest.raises(DriverError, match="eye: the server says that joints are not in rad"):
        radians_per_unit(said(17476), "eye", "rad")
