"""Tests of the public types: for type checkers of users, and for errors at run time."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import basecal
from basecal.errors import InputError
from basecal.simulation.scenario import Scenario

ROOT = Path(__file__).parents[1]
USE = """
import numpy as np

import basecal
from basecal import SE3, PoseEstimate

calibration, cell = basecal.read_calibration("x"), basecal.read_cell("x")
text: str = calibration.to_ur("a_from_b", cell=cell, folder="x", urdf=["x.urdf"])
text = basecal.export(calibration, "ur", folder="x", urdf=["x.urdf"])
pose = SE3(np.eye(3), [0, 0, 0])
moved: np.typing.NDArray[np.float64] = pose @ [1.0, 2.0, 3.0]
each: list[SE3] = [q @ pose for q in SE3.exp(np.zeros((3, 6)))]
estimate: PoseEstimate = pose @ calibration["a_from_b"] @ pose @ calibration["b_from_c"]
"""
MISUSE = """
calibration.to_sdf()
calibration.verdct
pose @ None
"""


@pytest.mark.journey
def test_type_checker_accepts_use_and_rejects_misuse(tmp_path: Path) -> None:
    """Methods of exports, sequences of numbers as arrays, and known transforms beside estimates are checked."""
    path = tmp_path / "use.py"
    path.write_text(USE + MISUSE, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", str(path)]
    environment = {**os.environ, "MYPYPATH": str(ROOT / "src")}
    said = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment).stdout
    lines = {int(line.split(":")[1]) for line in said.splitlines() if " error: " in line}
    first = USE.count("\n") + 2  # after an empty line
    assert lines == set(range(first, first + 3)), said


NOUNS = ("Cell", "Recording", "Calibration", "Settings", "Scenario")
TAKEN = [
    (function, parameter.name, parameter.annotation)
    for function in map(basecal.__getattr__, basecal.__all__)
    if inspect.isfunction(function)
    for parameter in inspect.signature(function).parameters.values()
    if parameter.annotation in NOUNS
]


@pytest.fixture(scope="module")
def nouns() -> dict[str, object]:
    """One object of each class, by its argument name."""
    made = basecal.simulate(Scenario(samples=4), 1)
    calibration = basecal.Calibration("good")
    return {
        "cell": made.cell,
        "recording": made.recording,
        **dict.fromkeys(("calibration", "first", "second"), calibration),
        "settings": basecal.Settings(),
        "scenario": Scenario(),
        "seed": 1,
        "kind": "ur",
    }


@pytest.mark.parametrize(
    ("function", "name", "kind"), [pytest.param(*each, id=f"{each[0].__name__}-{each[1]}") for each in TAKEN]
)
def test_public_function_names_an_argument_of_a_wrong_type(function, name, kind, nouns, tmp_path) -> None:
    """The error names the argument and both types, not a missing attribute of an inner call."""
    required = [key for key, each in inspect.signature(function).parameters.items() if each.default is each.empty]
    turns, places = np.eye(3)[None].repeat(4, 0), np.arange(12.0).reshape(4, 3)
    arrays = {"R": [turns] * len(required), "t": [k * places for k in range(len(required))]}
    of_arrays = {key: arrays[key[0]][k] if key[1:2] == "_" else tmp_path for k, key in enumerate(required)}
    arguments = of_arrays | {key: nouns[key] for key in required if key in nouns} | {name: None}
    with pytest.raises(InputError, match=f"^{name} is of type NoneType, expected {kind}$"):
        function(**arguments)
