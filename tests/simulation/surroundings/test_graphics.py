"""Tests of whether MuJoCo can render."""

from __future__ import annotations

import subprocess
import sys

import pytest

from basecal.simulation.surroundings import graphics


def test_missing_libraries_give_install_command(monkeypatch):
    """Linux without EGL and OSMesa gets the command that installs them."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(graphics, "find_library", lambda name: None)
    assert graphics.APT_LINE in graphics.missing_graphics()


def test_available_library_is_selected(monkeypatch):
    """If only OSMesa is found, it is selected for MuJoCo, unless the environment selects another."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(graphics, "find_library", lambda name: name if name == "OSMesa" else None)
    monkeypatch.setattr(graphics, "_try_rendering", lambda: None)
    for before, after in (("", "osmesa"), ("glfw", "glfw")):
        monkeypatch.setenv("MUJOCO_GL", before)  # restored at the end, also if the code sets it
        if not before:
            monkeypatch.delenv("MUJOCO_GL")
        assert graphics.missing_graphics() is None
        assert graphics.os.environ["MUJOCO_GL"] == after


def test_missing_mujoco_names_the_extra(monkeypatch):
    """One line states what to install."""
    monkeypatch.setattr(graphics, "find_spec", lambda name: None)
    assert graphics.missing_graphics().endswith("pip install 'basecal[sim]'")


@pytest.mark.journey
def test_unloadable_library_is_a_reason():
    """Any error of OpenGL's bindings becomes a reason in one line, not an exception."""
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'basecal[sim]'")
    code = "from basecal.simulation.surroundings.graphics import missing_graphics; print(missing_graphics())"
    output = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**graphics.os.environ, "MUJOCO_GL": "nothing"},
    ).stdout
    assert output.startswith("MuJoCo cannot draw (")
    assert output.count("\n") == 1
