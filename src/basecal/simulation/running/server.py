"""Server of a running cell on a local port: it answers each line with a line if the request has the token."""

from __future__ import annotations

import base64
import hmac
import socketserver
import threading
import time
from contextlib import ExitStack, suppress
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from basecal.cell.schema.errors import first_problem
from basecal.errors import BasecalError, InputError
from basecal.fields.values import Entry, Number, known_name_validator
from basecal.simulation.running.plant import Plant
from basecal.simulation.running.protocol import HOST, LONGEST_LINE_BYTES, MOST_JOINTS, decode, encode
from basecal.vision.image_file import png_bytes

REQUESTS = ("state", "move", "stop", "image", "light")
_LONGEST_REQUEST = 2**16  # bytes: a request has a few joints
_SILENCE_LIMIT_S = 0.3  # time without a request after which the arms of a real-time cell stop


class Request(Entry):
    """A request, with all its possible fields."""

    token: str
    do: Annotated[str, known_name_validator("request", REQUESTS)]
    robot: str = ""
    camera: str = ""
    on: bool = True
    speed_rad_s: Annotated[float, Field(gt=0, le=100)] = 1.0
    joints_rad: Annotated[list[Number], Field(max_length=MOST_JOINTS)] = Field(default_factory=list)


def _act(plant: Plant, request: Request) -> dict[str, Any]:
    """Execute a request; the reply without `ok`."""
    match request.do:
        case "state":
            stamp_s, joints = plant.state(request.robot)
            return {"stamp_s": stamp_s, "joints_rad": joints.tolist()}
        case "image":
            shot = plant.shot(request.camera)
            return {"stamp_s": shot.stamp_s, "png_base64": base64.b64encode(png_bytes(shot.image)).decode()}
        case "move":
            plant.move(request.robot, np.array(request.joints_rad, dtype=np.float64), request.speed_rad_s)
        case "stop":
            plant.stop(request.robot)
        case "light":
            plant.light(request.on)
    return {}


class CellServer(socketserver.ThreadingTCPServer):
    """Server of a running cell on the loopback interface.

    Attributes:
        plant: The cell.
        token: Token that every request must contain.
        port: TCP port of the server.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, plant: Plant, token: str, port: int = 0) -> None:
        self.plant, self.token = plant, token
        self._plant_lock = threading.Lock()
        self._last_request_s = time.monotonic()
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used ({error.strerror}): choose another, or none for a free one"
            ) from None

    @property
    def port(self) -> int:
        """TCP port of the server."""
        return int(self.server_address[1])

    def refuse_requests(self) -> None:
        """Wait for the current request, and block all later ones: the process aborts if it ends while it renders."""
        self._plant_lock.acquire()

    def stop(self) -> None:
        """Stop all arms."""
        with self._plant_lock:
            for robot in self.plant.robots:
                self.plant.stop(robot)

    def service_actions(self) -> None:
        """Stop all arms if no request arrives before a timeout, like the watchdog of a controller."""
        is_busy = self._plant_lock.locked()
        if self.plant.is_real_time and not is_busy and time.monotonic() - self._last_request_s > _SILENCE_LIMIT_S:
            self.stop()

    def answer(self, line: bytes) -> dict[str, Any]:
        """The reply to a line; an error reply for an invalid request."""
        try:
            request = self._check_request(decode(line))
            self._last_request_s = time.monotonic()
            with self._plant_lock:
                return {"ok": True, **_act(self.plant, request)}
        except BasecalError as error:
            return {"ok": False, "error": str(error)}

    def _check_request(self, message: dict[str, Any]) -> Request:
        token = message.get("token")
        given_token = token.encode("utf-8", "surrogatepass") if isinstance(token, str) else b""
        if not hmac.compare_digest(given_token, self.token.encode()):
            raise InputError("the token is missing or wrong; it is in derived/simulated.json of the cell")
        try:
            return Request.model_validate(message)
        except ValidationError as error:
            raise InputError(first_problem(error, Request)) from None


class _Handler(socketserver.StreamRequestHandler):
    server: CellServer
    disable_nagle_algorithm = True

    def handle(self) -> None:
        """Answer a connection line by line until it ends or a line is too long; then stop all arms."""
        with suppress(OSError), ExitStack() as ending:  # the client disconnected
            ending.callback(self.server.stop)
            while line := self.rfile.readline(_LONGEST_REQUEST):
                answer = encode(self.server.answer(line))
                self.wfile.write(
                    answer if len(answer) < LONGEST_LINE_BYTES else encode({"ok": False, "error": "too long"})
                )
                if not line.endswith(b"\n"):
                    return
