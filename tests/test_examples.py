"""Tests of the example programs: they run, and their results are correct."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import basecal
from basecal.reporting.statement.verdict import error_text

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.journey
def test_led_example_finds_the_base(tmp_path: Path) -> None:
    """Images with the LED on and off yield the base: chi-square below 33, exceeded by chance once in 1e5."""
    spec = importlib.util.spec_from_file_location("led_example", EXAMPLES / "led" / "run.py")
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    assert program.main(tmp_path, samples=12) < 33


@pytest.mark.journey
def test_python_example_of_imported_images(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The block of docs/importing.md yields a good result; without `detect` the error names that call."""
    page = (EXAMPLES.parent / "docs" / "importing.md").read_text(encoding="utf-8")
    block = re.search(r"^```python\n(cell = basecal.read_cell.*?)```", page, re.DOTALL | re.MULTILINE)
    assert block is not None
    shutil.copytree(EXAMPLES / "ur5e_images", tmp_path / "mycell")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"basecal": basecal}
    exec(block[1], names)
    assert names["calibration"].verdict == "good"
    estimate = names["calibration"]["eye_base_from_hand_base"]
    size = error_text(float(np.linalg.norm(estimate.sigma_t)), float(np.linalg.norm(estimate.sigma_r)))
    assert f"to {size} (1 sigma, 3-D norm)" in (EXAMPLES / "ur5e_images" / "README.md").read_text(encoding="utf-8")
    refused = basecal.calibrate(names["cell"], basecal.read_recording("mycell"))
    assert refused.verdict == "refused"
    assert "basecal.detect(cell, recording)" in refused.findings[0].message
