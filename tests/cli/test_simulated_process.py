"""Tests of `basecal simulate --process`: the renderer of its images."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest

from basecal.cli import main
from basecal.cli.simulated_process import _draws_surroundings, _end_with_input, _open_world, _print_address
from basecal.errors import InputError
from basecal.simulation.surroundings import graphics


def test_missing_library_is_reported_with_its_install_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Then only the target is drawn, and stderr has the line; users who request that get no line."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: f"nothing to draw with: {graphics.APT_LINE}")
    assert not _draws_surroundings("auto")
    assert graphics.APT_LINE in capsys.readouterr().err
    assert not _draws_surroundings("analytic")
    assert capsys.readouterr().err == ""


def test_whole_cell_is_drawn_with_the_library(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No option is needed, and no line is printed."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: None)
    assert _draws_surroundings("auto")
    assert capsys.readouterr().err == ""


def test_required_library_that_is_missing_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A cell that must be drawn by MuJoCo does not run without it."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: "nothing to draw with")
    assert main(["simulate", str(tmp_path / "cell"), "--process", "--renderer", "mujoco", "--target", "led"]) == 3
    assert capsys.readouterr().err.strip() == "basecal: error: nothing to draw with"


@pytest.mark.parametrize("target", ["pose", "points3d", "points"])
def test_running_cell_needs_a_target_in_images(tmp_path: Path, target: str) -> None:
    """A target seen only as poses or points in space is refused, and no file is written."""
    with pytest.raises(InputError, match=f"a running cell gives images, which show no '{target}'"):
        _open_world(tmp_path / "c", target, 0, ())
    assert not (tmp_path / "c").exists()


def test_address_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """Programs get it with the renderer, users with the next command."""
    for has_mujoco, renderer in ((True, "mujoco"), (False, "analytic")):
        _print_address(Path("my cell"), 4321, has_mujoco, json=True)
        data = json.loads(capsys.readouterr().out)
        assert (data["cell"], data["port"], data["renderer"]) == ("my cell", 4321, renderer)
    _print_address(Path("my cell"), 4321, has_mujoco=True, json=False)
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"my cell runs on {data['host']}:4321, its token is in {data['address']}")
    assert second == "next, in another terminal: basecal capture 'my cell' --pattern poses --go"


@pytest.mark.parametrize("has_input", [True, False])
def test_server_ends_with_its_input(monkeypatch: pytest.MonkeyPatch, has_input: bool) -> None:
    """Without an input it ends at once."""
    text, ended = BytesIO(b"more"), []
    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=text) if has_input else None)
    _end_with_input(SimpleNamespace(shutdown=lambda: ended.append(text.tell())))
    assert ended == [4 if has_input else 0]
