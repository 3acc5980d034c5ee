"""Tests of images and poses of samples for cameras that buffer images; the benchmark has more."""

from __future__ import annotations

import socketserver
import threading
import time

import cv2
import numpy as np
import pytest
from tests.shared.pose_trial import SIGMAS, Source, trial

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.opencv import open_camera
from basecal.acquisition.images.feed import feed_camera
from basecal.acquisition.images.latency import ArmMotion
from basecal.cell import Cell, Robot
from basecal.errors import DriverError
from basecal.vision import stream as module

pytestmark = pytest.mark.timed


@pytest.mark.parametrize(
    "source",
    [
        Source("opencv", "OTHER", (4,), 4),
        pytest.param(Source("opencv", "V4L2", (10,), 10), marks=pytest.mark.slow),
        pytest.param(Source("opencv", held=(6,)), marks=pytest.mark.slow),
        pytest.param(Source("folder", "slow"), marks=pytest.mark.slow),
        pytest.param(Source("folder", "shuffled"), marks=pytest.mark.slow),
    ],
    ids=lambda source: source.name,
)
def test_each_image_shows_its_recorded_pose(source):
    """Points in the images of two samples are where the recorded poses predict them."""
    outcome = trial(source, 2, seed=1)
    assert outcome["refused"] == []
    assert outcome["most_px"] < SIGMAS * outcome["sigma_px"]


class Freezing(socketserver.BaseRequestHandler):
    """MJPEG stream that stops after twenty images, and stays connected."""

    def handle(self):
        self.request.recv(4096)
        self.request.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n")
        for level in range(20):
            file = cv2.imencode(".jpg", np.full((48, 64), 10 * level, dtype=np.uint8))[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(file)}\r\n\r\n"
            self.request.sendall(head.encode() + file + b"\r\n")
            time.sleep(0.02)
        self.server.is_over.wait(20)


@pytest.fixture
def address():
    """Address of a stream that freezes."""
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Freezing) as server:
        server.daemon_threads, server.is_over = True, threading.Event()
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/stream.mjpg"
        server.is_over.set()
        server.shutdown()


def test_frozen_stream_is_reported_in_time(address, tmp_path, monkeypatch):
    """OpenCV's half minute is not waited for: the caller gets the error after the stated time."""
    monkeypatch.setattr(module, "_TIMEOUTS", [cv2.CAP_PROP_READ_TIMEOUT_MSEC, 700])
    feed = feed_camera(
        "wrist",
        open_camera(Place("wrist", Cell("eye", {"eye": Robot("eye")}), tmp_path, {"source": address})),
        ArmMotion(),
    )
    began_s = time.monotonic()

    def read_on():
        while True:
            feed.image()

    with pytest.raises(DriverError, match="wrist: the stream has ended, or the camera was pulled out"):
        read_on()
    assert time.monotonic() - began_s < 4.0
    feed.close()
