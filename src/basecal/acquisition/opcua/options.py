"""Options in `cell.yaml` of a robot with an OPC UA server."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from basecal.acquisition.reaching import SECRET_VARIABLE_PATTERN
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.fields.values import Entry, known_name_validator

NodePath = Annotated[str, Field(min_length=1)]


class OpcuaOptions(Entry):
    """Options of `kind: opcua`; without nodes, the axes of the Robotics companion specification are used.

    Attributes:
        url: Address of the server, such as `opc.tcp://192.168.0.20:4840`.
        device: Name of the motion device, if the server has several.
        joints: Nodes of the joints in the order of the URDF, or one node with all joints.
        unit: Unit of joints whose nodes do not state it.
        pose: Nodes of the flange's pose, or one node with all its numbers.
        notation: Controller whose convention the pose's numbers follow.
        user: User name, if the server requires a login.
        password_in: Name of the environment variable with the password; it begins with `BASECAL_`.
        rate_hz: Rate at which the nodes are read [Hz].
        reconnect_s: Timeout for re-establishing a lost connection [s].
    """

    url: Annotated[str, Field(pattern=r"^opc\.tcp://[^/:@\s]+(:\d{1,5})?(/\S*)?$")]
    device: str | None = None
    joints: list[NodePath] | NodePath | None = None
    unit: Literal["rad", "deg"] | None = None
    pose: list[NodePath] | NodePath | None = None
    notation: Annotated[str, known_name_validator("notation", tuple(CONTROLLERS))] | None = None
    user: str | None = None
    password_in: Annotated[str, Field(pattern=SECRET_VARIABLE_PATTERN)] = "BASECAL_OPCUA_PASSWORD"
    rate_hz: Annotated[float, Field(ge=20, le=500)] = 50.0
    reconnect_s: Annotated[float, Field(ge=0, le=3600)] = 10.0

    @model_validator(mode="after")
    def _check_nodes(self) -> OpcuaOptions:
        if self.joints is not None and self.pose is not None:
            raise ValueError("joints and pose are both named; expected one of them")
        if (self.pose is None) != (self.notation is None):
            raise ValueError("a pose needs its notation, and a notation a pose")
        return self

    @property
    def host(self) -> str:
        """Host name or IP address of the server."""
        return self.url.removeprefix("opc.tcp://").split("/")[0].split(":")[0]

    @property
    def port(self) -> int:
        """The server's port; by default 4840, the registered port of OPC UA."""
        _, _, port = self.url.removeprefix("opc.tcp://").split("/")[0].partition(":")
        return int(port or 4840)
