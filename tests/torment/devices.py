"""What drivers talk to, honest but for the link between, or hostile itself: one stage for each kind of driver."""

from __future__ import annotations

import itertools
import json
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import cache
from multiprocessing import Pipe
from pathlib import Path
from random import Random
from shutil import copytree
from typing import Any

import cv2
import numpy as np

from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.server import CellServer
from shared.facing_arms import facing_arms
from shared.opcua_place import free_port
from shared.second_process import own_host, second_process
from torment.cells import cell_text, made
from torment.damage import torn_bytes
from torment.faulty_link import choose_link, linked, played, reach
from torment.warm import server

Stage = Callable[[Random, Path], AbstractContextManager[list[str]]]
"""A context in which the words of a command line connect a driver to what is hostile."""

_KEPT = ExitStack()  # processes of devices, until this one ends
_UR_PORTS = (30004, 29999, 30001, 30002, 30003)
_TOKEN = "token"
_IMAGE_S = 0.04  # between images of a stream
_FILMS = {".avi": "MJPG", ".ts": "mpg2", ".mkv": "mp4v", ".mp4": "mp4v"}
_DATAGRAM = 1316  # bytes: seven packets of a transport stream
_RECONNECT_S = 1.0
_COUNT = itertools.count(os.getpid())
_FIRST_DOMAIN, _DOMAINS = 101, 100  # of DDS, of which each session has its own


def _check(folder: Path, name: str, driver: dict[str, Any], *more: str) -> list[str]:
    """The words that measure a driver of one robot or camera of a cell."""
    copytree(made("joints").folder, folder / "cell")
    cell = json.loads(json.dumps(made("joints").cell))
    cell["robots" if name in cell["robots"] else "cameras"][name]["driver"] = driver
    (folder / "cell" / "cell.yaml").write_text(cell_text(cell))
    return ["driver", "check", str(folder / "cell"), name, "--yes", *more]


@cache
def _ur_host() -> str:
    host = own_host()
    _KEPT.enter_context(second_process("shared.ur_controller", host))
    return host


@contextmanager
def ur_stage(chance: Random, folder: Path) -> Iterator[list[str]]:
    """A controller whose states lie, and in a third of the sessions its program, too."""
    host, far = own_host(), _ur_host()
    more = ["--go"] if chance.random() < 0.3 else []
    with linked(choose_link(chance), [reach((far, port)) for port in _UR_PORTS], [(host, port) for port in _UR_PORTS]):
        yield _check(folder, "eye", {"kind": "ur", "host": host, "reconnect_s": _RECONNECT_S}, *more)


@cache
def _opcua_port() -> int:
    port = free_port()
    _KEPT.enter_context(second_process("shared.opcua_robot", port))
    return port


@contextmanager
def opcua_stage(chance: Random, folder: Path) -> Iterator[list[str]]:
    """A server of asyncua behind a link that lies."""
    with linked(choose_link(chance), [reach(("127.0.0.1", _opcua_port()))], [("127.0.0.1", 0)]) as (port,):
        url = f"opc.tcp://127.0.0.1:{port}/robot"
        yield _check(folder, "eye", {"kind": "opcua", "url": url, "reconnect_s": _RECONNECT_S, "unit": "deg"})


@cache
def _cell_port() -> int:
    server = CellServer(Plant(facing_arms(), Clock(0)), _TOKEN)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server.port


@contextmanager
def simulated_stage(chance: Random, folder: Path) -> Iterator[list[str]]:
    """A running cell behind a link that lies: an arm, one that moves, or a camera."""
    with linked(choose_link(chance), [reach(("127.0.0.1", _cell_port()))], [("127.0.0.1", 0)]) as (port,):
        name, *more = chance.choice([("eye",), ("hand", "--go"), ("wrist",)])
        yield _check(folder, name, {"kind": "simulated", "port": port, "token": _TOKEN}, *more)


@cache
def _film(suffix: str) -> bytes:
    path = _kept_folder() / f"film{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*_FILMS[suffix]), 25, (64, 48))
    for k in range(100):
        writer.write(np.full((48, 64, 3), 5 * k % 255, np.uint8))
    writer.release()
    return path.read_bytes()


@cache
def _kept_folder() -> Path:
    from tempfile import TemporaryDirectory

    return Path(_KEPT.enter_context(TemporaryDirectory(prefix="torment-")))


def _stream_images(chance: Random) -> Callable[[socket.socket], None]:
    """A camera that answers HTTP with images, one after another."""

    def play(line: socket.socket) -> None:
        line.recv(4096)
        line.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=b\r\n\r\n")
        for k in range(10_000):
            content = cv2.imencode(".jpg", np.full((48, 64), k % 255, np.uint8))[1].tobytes()
            line.sendall(b"--b\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(content) + content)
            time.sleep(_IMAGE_S)

    return play


def _stream_film(chance: Random) -> Callable[[socket.socket], None]:
    content = _film(chance.choice(list(_FILMS)))

    def play(line: socket.socket) -> None:
        line.recv(4096)
        line.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: video/x-any\r\nContent-Length: %d\r\n\r\n" % len(content))
        line.sendall(content)

    return play


def _answer_rtsp(chance: Random) -> Callable[[socket.socket], None]:
    def play(line: socket.socket) -> None:
        number = 0
        while line.recv(4096):
            number += 1
            line.sendall(b"RTSP/1.0 200 OK\r\nCSeq: %d\r\nPublic: DESCRIBE, SETUP, PLAY\r\n\r\n" % number)

    return play


@contextmanager
def opencv_stage(chance: Random, folder: Path) -> Iterator[list[str]]:
    """Images by HTTP, films by HTTP, RTSP and UDP, a film that is damaged, and a pipe."""
    kind = chance.choice(["images", "images", "film", "rtsp", "udp", "file", "pipe"])
    if kind in ("file", "pipe"):
        words = _check(folder, "wrist", {"kind": "opencv", "source": kind})
        path = folder / "cell" / kind
        os.mkfifo(path) if kind == "pipe" else path.write_bytes(torn_bytes(_film(chance.choice(list(_FILMS))), chance))
        yield words
    elif kind == "udp":
        with _sent_by_udp(chance) as port:
            yield _check(folder, "wrist", {"kind": "opencv", "source": f"udp://127.0.0.1:{port}"})
    else:
        play = {"images": _stream_images, "film": _stream_film, "rtsp": _answer_rtsp}[kind](chance)
        with linked(choose_link(chance), [played(play)], [("127.0.0.1", 0)]) as (port,):
            scheme = "rtsp" if kind == "rtsp" else "http"
            yield _check(folder, "wrist", {"kind": "opencv", "source": f"{scheme}://127.0.0.1:{port}/a"})


@contextmanager
def _sent_by_udp(chance: Random) -> Iterator[int]:
    """A port to which packets of a film are sent, whole, torn, or none."""
    port, is_over, share = free_port(), threading.Event(), chance.choice([0, 0.1, 0.9])
    film, other = _film(".ts"), Random(chance.random())
    packets = [film[k : k + _DATAGRAM] for k in range(0, len(film), _DATAGRAM)]

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line, suppress(OSError):
            while chance_sends and not is_over.wait(_IMAGE_S):
                for packet in packets:
                    line.sendto(torn_bytes(packet, other) if other.random() < share else packet, ("127.0.0.1", port))

    chance_sends = chance.random() < 0.8
    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    try:
        yield port
    finally:
        is_over.set()


@contextmanager
def ros2_stage(chance: Random, folder: Path) -> Iterator[list[str]]:
    """A publisher of ROS 2 whose messages lie, in a domain of its own."""
    domain = _FIRST_DOMAIN + next(_COUNT) % _DOMAINS
    name, driver = chance.choice(
        [
            ("eye", {"topic": "/joint_states"}),
            ("eye", {"topic": "/pose"}),
            ("eye", {"frames": ["base_link", "tool0"]}),
            ("wrist", {"topic": "/wrist/image_raw"}),
        ]
    )
    words = _check(folder, name, {"kind": "ros2", "domain": domain, "reconnect_s": _RECONNECT_S, **driver})
    with _liar(domain, chance.randrange(2**31)):
        yield words


@contextmanager
def _liar(domain: int, seed: int) -> Iterator[None]:
    from torment import ros2_liar

    ready, is_ready = Pipe(duplex=False)
    process = server().Process(target=ros2_liar.main, args=(domain, seed, is_ready.send), daemon=True)
    process.start()
    is_ready.close()
    try:
        ready.recv()
        yield
    finally:
        process.kill()
        process.join()


def prepare(name: str) -> None:
    """Begin what the stages of a driver share, before several are used at once."""
    made("joints")
    {"driver ur": _ur_host, "driver opcua": _opcua_port, "driver simulated, peer": _cell_port}.get(name, lambda: None)()
    for suffix in _FILMS if name == "driver opencv" else ():
        _film(suffix)


STAGES: dict[str, Stage] = {
    "driver ur": ur_stage,
    "driver opcua": opcua_stage,
    "driver ros2": ros2_stage,
    "driver opencv": opencv_stage,
    "driver simulated, peer": simulated_stage,
}
