"""Robots whose controllers answer OPC UA (KUKA, ABB, FANUC, Yaskawa and others sell such servers), by asyncua.

They are watched, and led by a person: the Robotics companion specification has no commands to move.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from basecal.acquisition.driver import Place, Reading, checked_options
from basecal.acquisition.freshness import Waits
from basecal.acquisition.opcua.nodes import axes_of_devices, named_nodes, radians_of
from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.acquisition.opcua.session import Session, Values
from basecal.cell import RobotState
from basecal.errors import DatasetError, DriverError
from basecal.exchange.controllers.convention import convention
from basecal.geometry import Array


class OpcuaRobot:
    """A robot whose joints, or whose pose, are nodes of a server."""

    is_live = True

    def __init__(self, name: str, options: OpcuaOptions, joints: int) -> None:
        self._name, self._options, self._joints = name, options, joints
        self._waits = Waits(name)
        self._scale: Array = np.ones(joints)
        self._session = Session(name, options, self._found)
        self._next_s, self._last = 0.0, Values(float("-inf"), np.full(1, np.nan))

    def _found(self, client: Any) -> Sequence[Any]:
        options = self._options
        if options.pose is not None:
            return named_nodes(client, self._name, options.pose)
        if options.joints is not None:
            nodes = named_nodes(client, self._name, options.joints)
        else:
            nodes = axes_of_devices(client, self._name, options.device)
        radians = [radians_of(node, self._name, options.unit) for node in nodes]
        self._scale = np.array(radians if len(nodes) > 1 else radians * self._joints)
        return nodes

    def state(self) -> Reading:
        """Its next state, with the server's stamp of when the value was taken [s, UTC since 1970].

        Raises:
            DriverError: if the server has none, or does not answer though it was tried again.
        """
        began_s = time.monotonic()
        time.sleep(max(0.0, self._next_s - began_s))
        self._next_s = max(self._next_s, began_s) + 1 / self._options.rate_hz
        values = self._session.read()
        self._waits.add(time.monotonic() - began_s)
        self._check_stamps(values)
        self._last = values
        if self._options.notation is not None:
            return Reading(values.stamp_s, RobotState(convention(self._options.notation).read(values.numbers)))
        return Reading(values.stamp_s, RobotState(joints_rad=values.numbers * self._scale))

    def _check_stamps(self, values: Values) -> None:
        expected = self._joints if self._options.notation is None else len(convention(self._options.notation).names)
        if len(values.numbers) != expected:
            raise DriverError(
                f"{self._name}: the nodes hold {len(values.numbers)} numbers, expected {expected}; name the right ones"
            )
        if values.stamp_s < self._last.stamp_s or (
            values.stamp_s == self._last.stamp_s and not np.array_equal(values.numbers, self._last.numbers)
        ):
            raise DriverError(
                f"{self._name}: stale stamps: values changed, but their stamps stand still or go back; set the "
                f"clock of the server, or let it stamp what it reads"
            )

    def close(self) -> None:
        """Sign off."""
        self._session.close()


def open_robot(place: Place) -> OpcuaRobot:
    """A robot, with a session of its own.

    Raises:
        DatasetError: if an option is wrong, or joints are read of a robot without URDF.
        DriverError: if the server does not answer, refuses, or lacks the nodes.
        MissingExtra: if asyncua is not installed.
    """
    options = checked_options(place, OpcuaOptions)
    chain = place.cell.robots[place.name].chain
    if chain is None and options.pose is None:
        message = "joints need urdf, base_link and flange_link of the robot; without them name the nodes of its `pose`"
        raise DatasetError(str(place.folder / "cell.yaml"), message, field=f"robots.{place.name}.driver")
    return OpcuaRobot(place.name, options, 0 if chain is None else len(chain.joint_names))
