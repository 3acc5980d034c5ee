"""Robots with an OPC UA server (sold by KUKA, ABB, FANUC, Yaskawa and others), with asyncua.

A person leads these robots: the Robotics companion specification has no motion commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from basecal.acquisition.driver import Place, Reading, Secret, checked_options
from basecal.acquisition.links.reconnecting import ReconnectingRobot
from basecal.acquisition.opcua.nodes import axis_position_nodes, named_nodes, radians_per_unit
from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.acquisition.opcua.session import Session
from basecal.cell import RobotState
from basecal.errors import DriverError, count_text
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.geometry import Array


class OpcuaRobot(ReconnectingRobot):
    """A robot whose joints or pose are nodes of a server."""

    repeats_stamps = True  # many servers update a timestamp only when its value changes

    def __init__(self, name: str, options: OpcuaOptions, joints: int, allow_plaintext: bool) -> None:
        self._options, self._joints, self._allow_plaintext = options, joints, allow_plaintext
        self._scale: Array = np.ones(joints)
        super().__init__(name, options.reconnect_s, options.rate_hz)

    def connect(self) -> None:
        """Open a session.

        Raises:
            DriverError: if the server does not answer, refuses the session, or lacks the nodes.
        """
        self._session = Session(self.name, self._options, self._find_nodes, self._allow_plaintext)

    def disconnect(self) -> None:
        """Close the session."""
        self._session.close()

    def _find_nodes(self, client: Any) -> Sequence[Any]:
        options = self._options
        if options.pose is not None:
            return named_nodes(client, self.name, options.pose)
        if options.joints is not None:
            nodes = named_nodes(client, self.name, options.joints)
        else:
            nodes = axis_position_nodes(client, self.name, options.device)
        factors = [radians_per_unit(node, self.name, options.unit) for node in nodes]
        self._scale = np.array(factors if len(nodes) > 1 else factors * self._joints)
        return nodes

    def read(self) -> Reading:
        """Read all nodes; the timestamp is the newest of their source timestamps [s, UTC since 1970].

        Raises:
            DriverError: if the server has no value of a node, or the number of values is wrong.
        """
        values = self._session.read()
        notation = None if self._options.notation is None else CONTROLLERS[self._options.notation]
        expected = self._joints if notation is None else len(notation.names)
        if len(values.numbers) != expected:
            held = count_text(len(values.numbers), "number")
            raise DriverError(f"{self.name}: the nodes hold {held}, expected {expected}; name the right ones")
        if notation is not None:
            return Reading(values.stamp_s, RobotState(notation.read(values.numbers)))
        return Reading(values.stamp_s, RobotState(joints_rad=values.numbers * self._scale))


def reaches(place: Place) -> str:
    """Description of the server and the login.

    Raises:
        DatasetError: if an option is wrong.
    """
    options = checked_options(place, OpcuaOptions)
    login = "" if options.user is None else f" as {options.user!r} with the password in {options.password_in}"
    return f"{options.url}{login}"


def secret(place: Place) -> Secret | None:
    """The password; None without a login.

    Raises:
        DatasetError: if an option is wrong.
    """
    options = checked_options(place, OpcuaOptions)
    return None if options.user is None else Secret(options.password_in, f"{options.user!r} at {options.url}")


def open_robot(place: Place) -> OpcuaRobot:
    """Open a robot with its own session.

    Raises:
        DatasetError: if an option is wrong, or joints are read from a robot without a URDF.
        DriverError: if the server does not answer, refuses the session, or lacks the nodes.
        MissingExtra: if asyncua is not installed.
    """
    options = checked_options(place, OpcuaOptions)
    chain = place.cell.robots[place.name].chain
    if chain is None and options.pose is None:
        message = "joints need urdf, base_link and flange_link of the robot; without them name the nodes of its `pose`"
        raise place.error(message)
    joints = 0 if chain is None else len(chain.joint_names)
    return OpcuaRobot(place.name, options, joints, place.allow_plaintext)
