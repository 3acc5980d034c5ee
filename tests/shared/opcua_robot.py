"""A robot that answers OPC UA as in the Robotics companion specification: `python -m shared.opcua_robot PORT`.

Anonymous users may read, and the user `cell` with the password `secret`. Lines on the standard input change the state.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from datetime import UTC, datetime

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager

DEGREE = ua.EUInformation(UnitId=17476, DisplayName=ua.LocalizedText("deg"))
AXIS_ORDER = ("A10", "A2", "A3", "A4", "A5", "A1")  # as a server may list them
DEGREES = {"A1": 10.0, "A2": -90.0, "A3": 90.0, "A4": 0.0, "A5": 30.0, "A10": 5.0}


class OneUser(UserManager):
    """Anonymous users, and one user with a password."""

    def get_user(self, iserver, username=None, password=None, certificate=None):
        return User(role=UserRole.User) if username is None or (username, password) == ("cell", "secret") else None


async def build(server):
    """The nodes of the axes by name, a node with a pose, and a node of joints without a unit."""
    index = await server.register_namespace("http://opcfoundation.org/UA/Robotics/")
    devices = await server.nodes.objects.add_folder(index, "DeviceSet")
    system = await devices.add_object(index, "System")
    device = await (await system.add_folder(index, "MotionDevices")).add_object(index, "arm")
    axes = await device.add_folder(index, "Axes")
    positions = {}
    for name in AXIS_ORDER:
        parameters = await (await axes.add_object(index, name)).add_object(index, "ParameterSet")
        positions[name] = await parameters.add_variable(index, "ActualPosition", DEGREES[name])
        await positions[name].add_property(0, "EngineeringUnits", DEGREE)
    own = await server.nodes.objects.add_folder(index, "Own")
    pose = await own.add_variable(ua.NodeId("pose", index), "Pose", [100.0, 200.0, 300.0, 10.0, 20.0, 30.0])
    array = await own.add_variable(ua.NodeId("joints", index), "Joints", [0.1] * 6)
    return positions, pose, array


async def serve(port):
    server = Server(user_manager=OneUser())
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/robot")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    positions, _, array = await build(server)
    async with server:
        print("ready", flush=True)
        reader = asyncio.StreamReader()
        loop = asyncio.get_running_loop()
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
        began = datetime.now(UTC)
        while line := (await reader.readline()).decode().split():
            word, *rest = line
            if word == "reset":
                await array.write_value([0.1] * 6)
            if word in ("turn", "reset"):
                for name, degrees in DEGREES.items():
                    value = ua.DataValue(ua.Variant(degrees + sum(map(float, rest))), SourceTimestamp=datetime.now(UTC))
                    await positions[name].write_value(value)
            elif word == "turn_unstamped":
                for k, name in enumerate(DEGREES):
                    await positions[name].write_value(
                        ua.DataValue(ua.Variant(k + float(rest[0])), SourceTimestamp=began)
                    )
            elif word == "bad":
                await positions["A3"].write_value(
                    ua.DataValue(ua.Variant(0.0), ua.StatusCode(ua.StatusCodes.BadSensorFailure))
                )
            elif word == "few":
                await array.write_value([0.1] * 5)
            print("ok", flush=True)
        os._exit(0)  # sessions that are open would be waited for


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    asyncio.run(serve(int(sys.argv[1])))
