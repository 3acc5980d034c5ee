"""The nodes of a robot's joints: named in the cell, or given by the Robotics companion specification.

Source: OPC 40010-1, OPC UA for Robotics, 7.1 and 7.2: Objects/DeviceSet/<system>/MotionDevices/<device>/Axes/<axis>/
ParameterSet/ActualPosition, each with its EngineeringUnits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from basecal.errors import DriverError, list_names

_RADIANS_OF_UNIT = {b"C81": 1.0, b"DD": math.radians(1)}  # codes of rad and deg in UN/ECE recommendation 20
_RADIANS_OF_WORD = {"rad": 1.0, "deg": math.radians(1)}


def named_nodes(client: Any, name: str, paths: str | Sequence[str]) -> list[Any]:
    """Nodes from their ids (`ns=2;s=Axis1`), or from browse paths below the objects (`DeviceSet/Robot/Axis1`).

    Raises:
        DriverError: if a path does not exist; the message lists the existing names.
    """
    return [_node(client, name, path) for path in ([paths] if isinstance(paths, str) else paths)]


def _node(client: Any, name: str, path: str) -> Any:
    if re.match(r"(ns=\d+;)?[isgb]=", path):
        return client.get_node(path)
    node = client.nodes.objects
    for word in path.removeprefix("Objects/").split("/"):
        children = _children(node)
        if word not in children:
            raise DriverError(f"{name}: no node {word!r} of {path!r}; there are: {list_names(sorted(children))}")
        node = children[word]
    return node


def axis_position_nodes(client: Any, name: str, device: str | None) -> list[Any]:
    """Position nodes of all axes of a motion device, sorted by number if all names end in a number.

    Raises:
        DriverError: if the server has no such device, has several devices and no name is given, or has no positions.
    """
    systems = _children(_children(client.nodes.objects).get("DeviceSet"))
    devices = {
        key: each
        for system in systems.values()
        for key, each in _children(_children(system).get("MotionDevices")).items()
    }
    if device is None and len(devices) == 1:
        device = next(iter(devices))
    if device not in devices:
        problem = (
            f"no motion device {device!r}" if device else "`device` is not stated" if devices else "no motion device"
        )
        raise DriverError(
            f"{name}: {problem}; there are: {list_names(sorted(devices))}. "
            f"Name the device, or the nodes of its `joints`"
        )
    axes = _children(_children(devices[device]).get("Axes"))
    numbers = {axis: re.findall(r"\d+$", axis) for axis in axes}
    ordered = sorted(axes, key=lambda axis: int(numbers[axis][0])) if all(numbers.values()) else list(axes)
    positions = [_children(_children(axes[axis]).get("ParameterSet")).get("ActualPosition") for axis in ordered]
    nodes = [each for each in positions if each is not None]
    if not nodes:
        raise DriverError(f"{name}: the axes of {device!r} have no ActualPosition; name the nodes of its `joints`")
    return nodes


def _children(node: Any) -> dict[str, Any]:
    """Children of a node by browse name; empty for None."""
    return {} if node is None else {each.read_browse_name().Name: each for each in node.get_children()}


def radians_per_unit(node: Any, name: str, unit_name: str | None) -> float:
    """Conversion factor from the unit of a joint's node to radians.

    Raises:
        DriverError: if neither the node nor the cell states the unit, or they differ.
    """
    stated = None
    units = _children(node).get("EngineeringUnits")
    if units is not None:
        unit = units.read_value()
        code = unit.UnitId.to_bytes(4, "big").lstrip(b"\0") if unit.UnitId > 0 else b""
        stated = _RADIANS_OF_UNIT.get(code, _RADIANS_OF_WORD.get(unit.DisplayName.Text or ""))
    if unit_name is not None and stated is not None and stated != _RADIANS_OF_WORD[unit_name]:
        raise DriverError(
            f"{name}: the server says that joints are not in {unit_name}: leave `unit` out, or look at {node}"
        )
    if unit_name is not None:
        return _RADIANS_OF_WORD[unit_name]
    if stated is None:
        raise DriverError(f"{name}: {node} does not state its unit: state `unit: deg` or `unit: rad` in cell.yaml")
    return stated
