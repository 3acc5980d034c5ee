"""Whether MuJoCo can draw on this machine, and what would let it."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library
from importlib.util import find_spec

APT_LINE = "apt-get install libegl1 libgl1"
"""What brings a library to draw with to Debian and Ubuntu, without a screen or a graphics card."""

_BACKEND_VARIABLE = "MUJOCO_GL"  # by which MuJoCo is told what to draw with, before it is imported
_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # those that need no screen, the faster first


def missing_graphics() -> str | None:
    """Why MuJoCo draws nothing here, and what to do; None if it can.

    What it is to draw with is chosen, where nobody has: of Linux what needs no screen.
    """
    if find_spec("mujoco") is None:
        return "MuJoCo is not installed: pip install 'basecal[sim]'"
    if sys.platform == "linux" and _BACKEND_VARIABLE not in os.environ:
        there = [name for name, library in _LIBRARIES.items() if find_library(library) is not None]
        if not there:
            return f"no library to draw with (EGL or OSMesa): {APT_LINE}"
        os.environ[_BACKEND_VARIABLE] = there[0]
    return _try_rendering()


def _try_rendering() -> str | None:
    """Why a first tiny image fails; None if it is drawn."""
    try:
        import mujoco

        model = mujoco.MjModel.from_xml_string("<mujoco/>")
        renderer = mujoco.Renderer(model, 8, 8)
        renderer.update_scene(mujoco.MjData(model))
        renderer.render()
        renderer.close()
    except Exception as error:  # of OpenGL's bindings: AttributeError, ImportError, RuntimeError and their own
        first = str(error).splitlines()[0] if str(error) else ""
        return f"MuJoCo cannot draw ({type(error).__name__}: {first}): {APT_LINE}"
    return None
