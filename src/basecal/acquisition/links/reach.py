"""Whether something listens at an address, and in a line why not: what clients of controllers say in many, or never."""

from __future__ import annotations

import socket

from basecal.errors import DriverError

_CONNECT_S = 3.0  # a controller in the same building answers within milliseconds; one that boots, never


def connect(name: str, host: str, port: int, device: str) -> socket.socket:
    """A connection to a port, whose reads give up after three seconds.

    Args:
        name: The robot or camera.
        host: Name or number of the other computer.
        port: The port.
        device: What should listen there, for the error.

    Raises:
        DriverError: if there is no such host, it does not answer, or nothing listens.
    """
    try:
        return socket.create_connection((host, port), timeout=_CONNECT_S)
    except socket.gaierror:
        why = f"there is no host {host!r}: look at its address in cell.yaml"
    except ConnectionRefusedError:
        why = f"nothing listens at {host}:{port}: is {device} running there, and is the port right?"
    except PermissionError:
        why = f"this computer may not connect to {host}:{port}: a firewall or a rule of the system forbids it"
    except OSError:
        why = f"{host}:{port} is not reachable: is it on, and in the same network?"
    raise DriverError(f"{name}: {why}")
