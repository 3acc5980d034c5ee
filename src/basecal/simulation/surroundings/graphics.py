"""Check whether MuJoCo can render on this machine, and how to enable it."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library
from importlib.util import find_spec

APT_LINE = "apt-get install libegl1 libgl1"
"""Command that installs a rendering library on Debian and Ubuntu, for machines without a screen or graphics card."""

_BACKEND_VARIABLE = "MUJOCO_GL"  # selects the rendering backend; MuJoCo reads it when it is imported
_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # backends without a screen, the fastest first


def missing_graphics() -> str | None:
    """The reason why MuJoCo cannot render here, and what to do; None if it can.

    On Linux, a backend without a screen is selected if the variable MUJOCO_GL is not set.
    """
    if find_spec("mujoco") is None:
        return "MuJoCo is not installed: pip install 'basecal[sim]'"
    if sys.platform == "linux" and _BACKEND_VARIABLE not in os.environ:
        there = [name for name, library in _LIBRARIES.items() if find_library(library) is not None]
        if not there:
            return f"no rendering library (EGL or OSMesa): {APT_LINE}"
        os.environ[_BACKEND_VARIABLE] = there[0]
    return _try_rendering()


def _try_rendering() -> str | None:
    """Render a small test image; the reason if this fails, else None."""
    try:
        import mujoco

        model = mujoco.MjModel.from_xml_string("<mujoco/>")
        renderer = mujoco.Renderer(model, 8, 8)
        renderer.update_scene(mujoco.MjData(model))
        renderer.render()
        renderer.close()
    except Exception as error:  # bindings of OpenGL raise AttributeError, ImportError, RuntimeError and others
        first = str(error).splitlines()[0] if str(error) else ""
        return f"MuJoCo cannot draw ({type(error).__name__}: {first}): {APT_LINE}"
    return None
