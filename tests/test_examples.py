"""The examples that are programs run, and end where they should."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.journey
def test_a_light_from_images(tmp_path: Path) -> None:
    """From images with the light on and off to the base: squared sigmas below 33, a chance of 1e-5."""
    spec = importlib.util.spec_from_file_location("led_example", EXAMPLES / "led" / "run.py")
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    assert program.main(tmp_path, samples=12) < 33
