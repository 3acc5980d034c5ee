"""Tests of confirmations before a cell connects to anything, whoever wrote the cell."""

from __future__ import annotations

import io
import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from basecal.cell.format.locking import locked_folder
from basecal.cli import main, terminal

CELL = """schema: basecal/cell/1
reference: eye
robots:
  eye: {driver: %s}
cameras:
  wrist:
    on: eye
    mount: {status: free, guess: {t_m: [0, 0, 0.1], rpy_deg: [0, 0, 0]}}
    size_px: [640, 480]
    driver: %s
targets:
  light: {on: world, mount: {status: free, guess: {t_m: [1, 0, 0], rpy_deg: [0, 0, 0]}}, kind: led}
"""


class Stranger:
    """Foreign server that records connections."""

    def __init__(self) -> None:
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.came = 0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                line, _ = self.socket.accept()
            except OSError:
                return
            self.came += 1
            line.close()


@pytest.fixture
def stranger() -> Iterator[Stranger]:
    """Foreign server that listens during a test."""
    server = Stranger()
    yield server
    server.socket.close()


def write(folder: Path, robot: dict[str, object], camera: dict[str, object]) -> Path:
    """Write a cell with these drivers."""
    (folder / "cell.yaml").write_text(CELL % (json.dumps(robot), json.dumps(camera)))
    return folder


TYPED = {"kind": "typed"}


def drivers(port: int) -> dict[str, tuple[dict[str, object], dict[str, object]]]:
    """Drivers of a robot and a camera that would connect to a port."""
    here = {"kind": "folder", "path": "."}
    return {
        "opcua": ({"kind": "opcua", "url": f"opc.tcp://127.0.0.1:{port}", "pose": "a", "notation": "ur"}, here),
        "simulated": ({"kind": "simulated", "port": port, "token": "x"}, here),
        "opencv": (TYPED, {"kind": "opencv", "source": f"http://127.0.0.1:{port}/a"}),
        "folder": (TYPED, {"kind": "folder", "path": "/"}),
        "device": (TYPED, {"kind": "opencv", "source": 0}),
        "link": (TYPED, {"kind": "folder", "path": "link"}),
        "ros2": ({"kind": "ros2", "topic": "/a", "domain": 77}, here),
        "ur": ({"kind": "ur", "host": "127.0.0.1"}, here),
    }


@pytest.mark.parametrize("kind", drivers(0))
def test_no_connection_without_confirmation(
    tmp_path: Path, stranger: Stranger, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    """Without a terminal and without --yes, a cell with an outside connection is refused with exit code 2."""
    (tmp_path / "link").symlink_to("/")
    folder = write(tmp_path, *drivers(stranger.port)[kind])
    assert main(["capture", str(folder)]) == 2
    said = capsys.readouterr().err
    assert "Add --yes" in said
    assert not stranger.came


def test_secret_of_another_program_is_not_sent(
    tmp_path: Path, stranger: Stranger, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cell that requests one is refused, with or without --yes.

    The cell's own secret is requested if the environment lacks it.
    """
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "hush")
    robot, camera = drivers(stranger.port)["opcua"]
    folder = write(tmp_path, {**robot, "user": "me", "password_in": "AWS_SECRET_ACCESS_KEY"}, camera)
    assert main(["capture", str(folder), "--yes"]) == 3
    assert "robots.eye.driver.password_in" in capsys.readouterr().err
    write(tmp_path, {**robot, "user": "me"}, camera)
    assert main(["capture", str(folder), "--yes"]) == 2
    assert "is missing: put it into BASECAL_OPCUA_PASSWORD" in capsys.readouterr().err
    assert not stranger.came


@pytest.mark.journey
def test_confirmation_is_asked_once_for_each_address(
    tmp_path: Path, stranger: Stranger, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No means no connection; yes is remembered for this cell and this address only."""
    folder = write(tmp_path, *drivers(stranger.port)["simulated"])
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    monkeypatch.setattr("sys.stdin", io.StringIO("n\ny\n"))
    assert main(["capture", str(folder)]) == 2
    assert not stranger.came
    assert main(["capture", str(folder)]) == 3
    assert stranger.came
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: False)
    capsys.readouterr()
    assert main(["capture", str(folder)]) == 3
    assert "connects to" not in capsys.readouterr().err
    other = Stranger()
    write(tmp_path, *drivers(other.port)["simulated"])
    assert main(["capture", str(folder)]) == 2
    assert not other.came


def test_drivers_within_the_cell_need_no_confirmation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder of the cell and typed poses are used at once."""
    folder = write(tmp_path, {"kind": "typed"}, {"kind": "folder", "path": "images"})
    main(["capture", str(folder)])
    assert "connects to" not in capsys.readouterr().err


@pytest.mark.journey
def test_second_capture_of_a_cell_is_refused(
    tmp_path: Path, stranger: Stranger, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second capture connects to nothing and reports the first; a free cell is reached."""
    folder = write(tmp_path, *drivers(stranger.port)["simulated"])
    with locked_folder(folder):
        assert main(["capture", str(folder), "--yes"]) == 3
        assert "is in use by another capture or driver check. Wait until it ends" in capsys.readouterr().err
        assert not stranger.came
    assert main(["capture", str(folder), "--yes"]) == 3
    assert stranger.came
