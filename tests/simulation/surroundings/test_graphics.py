"""Whether MuJoCo can draw."""

from __future__ import annotations

import subprocess
import sys

import pytest

from basecal.simulation.surroundings import graphics


def test_a_machine_without_a_library_is_told_the_line(monkeypatch):
    """Of Linux without EGL and OSMesa the answer is the line that brings them."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(graphics, "find_library", lambda name: None)
    assert graphics.APT_LINE in graphics.missing_graphics()


def test_the_first_library_there_is_chosen(monkeypatch):
    """Where only OSMesa is found, MuJoCo is told so, unless somebody has chosen."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(graphics, "find_library", lambda name: name if name == "OSMesa" else None)
    monkeypatch.setattr(graphics, "_try_rendering", lambda: None)
    for before, after in ((None, "osmesa"), ("glfw", "glfw")):
        monkeypatch.delenv("MUJOCO_GL", raising=False)
        if before:
            monkeypatch.setenv("MUJOCO_GL", before)
        assert graphics.missing_graphics() is None
        assert graphics.os.environ["MUJOCO_GL"] == after


def test_without_mujoco_the_extra_is_named(monkeypatch):
    """One line says what to install."""
    monkeypatch.setattr(graphics, "find_spec", lambda name: None)
    assert graphics.missing_graphics().endswith("pip install 'basecal[sim]'")


def test_a_library_that_does_not_load_is_an_answer_and_no_error():
    """Whatever OpenGL's bindings raise ends in one line."""
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'basecal[sim]'")
    code = "from basecal.simulation.surroundings.graphics import missing_graphics; print(missing_graphics())"
    said = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**graphics.os.environ, "MUJOCO_GL": "nothing"},
    ).stdout
    assert said.startswith("MuJoCo cannot draw (")
    assert said.count("\n") == 1
