"""Cameras that delay images, for `pose_trial`: every image shows the arm at the time of its exposure.

An arm slides along two axes in front of a board; the camera sees the image of the board, shifted. The path is in shared
memory, and all processes read one monotonic clock.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.acquisition.driver import Reading
from basecal.cell import RobotState
from basecal.geometry import SE3

IMAGES_HZ = 30.0
MOVE_S = 0.3
NOISE_LEVELS = 1.0
TICK_S = 1 / 125  # between states
PROCESSES = multiprocessing.get_context("spawn")  # a fork of a process whose threads read cameras may wait for ever

Bytes = NDArray[np.uint8]


class ArmPath:
    """Position of the arm [m] at any time: begin, duration, start and goal, in shared memory."""

    def __init__(self) -> None:
        self.memory = PROCESSES.Array("d", 6)

    def go(self, to: NDArray[np.float64], seconds: float) -> None:
        """Begin a motion."""
        now_s = time.monotonic()
        here = self.position(now_s)
        with self.memory:
            self.memory[:] = [now_s, seconds, *here, *to]

    def position(self, time_s: float) -> NDArray[np.float64]:
        """The position at a time [m]."""
        with self.memory:
            begin, seconds, *ends = self.memory[:]
        share = np.clip((time_s - begin) / max(seconds, 1e-9), 0.0, 1.0)
        eased = 0.5 - 0.5 * np.cos(np.pi * share)
        return np.array(ends[:2]) + eased * (np.array(ends[2:]) - np.array(ends[:2]))


class Scene:
    """Images of a board by the position of the arm.

    Args:
        board: (h, w) image at the origin.
        px_per_m: Shift of the board in the image for a metre of the arm [px].
        path: Path of the arm.
        seed: Seed of the noise.
    """

    def __init__(self, board: Bytes, px_per_m: float, path: ArmPath, seed: int) -> None:
        self.board, self.px_per_m, self.path = board, px_per_m, path
        self._rng = np.random.default_rng(seed)
        self._noise = self._rng.normal(0, NOISE_LEVELS, (2 * board.shape[0], 2 * board.shape[1])).astype(np.float32)

    def image(self, exposed_s: float) -> Bytes:
        """The image of an instant, with fresh noise."""
        u, v = -self.px_per_m * self.path.position(exposed_s)
        height, width = self.board.shape
        shifted = cv2.warpAffine(
            self.board.astype(np.float32),
            np.array([[1, 0, u], [0, 1, v]]),
            (width, height),
            flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        row, column = self._rng.integers(height), self._rng.integers(width)
        noisy = shifted + self._noise[row : row + height, column : column + width]
        return np.clip(noisy, 0, 255).astype(np.uint8)


class Arm:
    """An arm that moves along the path."""

    is_live = True

    def __init__(self, path: ArmPath) -> None:
        self._path = path

    def state(self) -> Reading:
        """The next state, at 125 Hz."""
        time.sleep(TICK_S)
        now_s = time.monotonic()
        return Reading(now_s, RobotState(SE3(np.eye(3), np.array([*self._path.position(now_s), 0.0]))))

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Begin a motion."""
        assert to.base_from_flange is not None
        self._path.go(to.base_from_flange.translation[:2], MOVE_S)

    def stop(self) -> None:
        """Do nothing: the arm comes to rest at its goal."""

    def close(self) -> None:
        """Do nothing."""


def ticks(hz: float, is_over: Callable[[], bool]) -> Iterator[float]:
    """Instants of exposure until it is over; missed ones are left out."""
    due_s = time.monotonic()
    while not is_over():
        time.sleep(max(0.0, due_s - time.monotonic()))
        yield due_s
        due_s = max(due_s + 1 / hz, time.monotonic())


class Delay:
    """A queue that delays images by a number of frames; while the number grows, the oldest image repeats."""

    def __init__(self, frames: Callable[[], int]) -> None:
        self._frames, self._held = frames, deque[Any]()

    def pass_image(self, image: Any) -> Any:
        """Append an image, and return the delayed one."""
        self._held.append(image)
        while len(self._held) > self._frames() + 1:
            self._held.popleft()
        return self._held[0]


class BufferingCapture:
    """A stand-in for `cv2.VideoCapture` of a device, whose driver fills buffers and drops images while all are full.

    Attributes:
        scene: The scene of the camera.
        buffers: Number of images that wait until they are read.
        delay: Images by which the camera itself is late.
        backend: `V4L2`, whose images have the time of their exposure, or another.
    """

    scene: Scene
    buffers = 1
    delay = 0
    backend = "OTHER"

    def __init__(self, *source: Any) -> None:
        self._filled: Queue[tuple[float, Bytes]] = Queue(self.buffers)
        self._is_over = threading.Event()
        self._stamp_s = 0.0
        threading.Thread(target=self._fill, daemon=True).start()

    def _fill(self) -> None:
        delay = Delay(lambda: self.delay)
        for exposed_s in ticks(IMAGES_HZ, self._is_over.is_set):
            image = delay.pass_image((exposed_s, self.scene.image(exposed_s)))
            if not self._filled.full():
                self._filled.put(image)

    def open(self, *source: Any) -> bool:
        """Always true."""
        return True

    isOpened = open

    def getBackendName(self) -> str:
        """Name of the backend."""
        return self.backend

    def get(self, property_id: int) -> float:
        """The time of the last image [ms]."""
        return 1e3 * self._stamp_s

    def read(self) -> tuple[bool, Bytes | None]:
        """The oldest waiting image."""
        try:
            self._stamp_s, image = self._filled.get(timeout=2.0)
        except Empty:
            return False, None
        return True, image

    def release(self) -> None:
        """Stop the images."""
        self._is_over.set()


def _serve(scene: Scene, delay: Any, port: Any) -> None:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            held = Delay(lambda: int(delay.value))
            try:
                for exposed_s in ticks(IMAGES_HZ, lambda: False):
                    file = held.pass_image(cv2.imencode(".jpg", scene.image(exposed_s))[1].tobytes())
                    head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(file)}\r\n\r\n"
                    self.wfile.write(head.encode() + file + b"\r\n")
            except OSError:
                return

        def log_message(self, *words: Any) -> None:
            pass

    cv2.setNumThreads(1)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    port.value = server.server_address[1]
    server.serve_forever()


@contextmanager
def mjpeg_server(scene: Scene, delay: Any) -> Iterator[str]:
    """The address of an MJPEG stream of another process; `delay` [images] may change meanwhile."""
    port = PROCESSES.Value("i", 0)
    process = PROCESSES.Process(target=_serve, args=(scene, delay, port), daemon=True)
    process.start()
    try:
        while not port.value:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{port.value}/stream.mjpg"
    finally:
        process.terminate()
        process.join()


def _save(scene: Scene, folder: Path, way: str, seed: int) -> None:
    """Save images continuously: `at once`, `slow`ly, or `shuffled` by a transfer that keeps file times."""
    cv2.setNumThreads(1)
    rng, waiting = np.random.default_rng(seed), list[tuple[float, float, Bytes]]()
    wall_s = time.time() - time.monotonic()
    for number, exposed_s in enumerate(ticks(20.0, lambda: False)):
        late_s = {"at once": 0.0, "slow": 0.25, "shuffled": rng.choice([0.0, 0.12, 1.0], p=[0.8, 0.15, 0.05])}[way]
        waiting.append((exposed_s + late_s, exposed_s, scene.image(exposed_s)))
        for each in sorted((each for each in waiting if each[0] <= exposed_s), key=lambda each: each[0]):
            path = folder / f"{number:06d}_{each[1]:.3f}.jpg"
            path.with_suffix(".part").write_bytes(cv2.imencode(".jpg", each[2])[1].tobytes())
            if way == "shuffled":
                os.utime(path.with_suffix(".part"), (wall_s + each[1], wall_s + each[1]))
            path.with_suffix(".part").rename(path)
        waiting = [each for each in waiting if each[0] > exposed_s]


@contextmanager
def saving(scene: Scene, folder: Path, way: str, seed: int) -> Iterator[None]:
    """Run a process that saves images into a folder within the context."""
    folder.mkdir(parents=True)
    process = PROCESSES.Process(target=_save, args=(scene, folder, way, seed), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.terminate()
        process.join()
