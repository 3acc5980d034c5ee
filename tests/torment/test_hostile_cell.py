"""A cell whose every field leads out of it, opened by verbs under a tracer: no connection, and no file outside."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from shutil import copytree

import pytest

from torment.cells import cell_text, made
from torment.system_calls import is_possible

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not is_possible(), reason="needs strace, and leave to hold others")]

_CONNECTED = re.compile(r"\b(?:connect|sendto)\(\d+, .*AF_INET")
_VERBS = (
    ("calibrate",),
    ("detect",),
    ("report",),
    ("plan", "--samples", "1", "--task-point", "0.5", "0", "0.3"),
    ("export", "--to", "json"),
    ("fix",),
    ("capture",),
    ("verify", "recording/samples.jsonl"),
)
_DRIVERS = (
    {"kind": "opcua", "url": "opc.tcp://127.0.0.1:9", "joints": ["a"], "unit": "rad", "user": "me"},
    {"kind": "ur", "host": "127.0.0.1"},
)


def _hostile(folder: Path, outside: Path, field: str) -> None:
    """A cell of which a field names what is outside, and whose arms and camera name other machines."""
    copytree(made("joints").folder, folder)
    cell, samples = json.loads(json.dumps(made("joints").cell)), list(made("joints").samples)
    for robot, driver in zip(cell["robots"].values(), _DRIVERS, strict=True):
        robot["driver"] = driver
    cell["cameras"]["wrist"]["driver"] = {"kind": "opencv", "source": "http://127.0.0.1:9/x"}
    if field == "urdf":
        cell["robots"]["eye"]["urdf"] = str(outside)
    elif field == "link":
        (folder / "eye.urdf").unlink()
        (folder / "eye.urdf").symlink_to(outside)
    elif field != "drivers alone":
        name = os.path.relpath(outside, folder) if field == "relative image" else str(outside)
        samples = [sample | {"images": {"wrist": name}, "observations": []} for sample in samples]
    (folder / "cell.yaml").write_text(cell_text(cell))
    (folder / "recording" / "samples.jsonl").write_text("".join(json.dumps(sample) + "\n" for sample in samples))


@pytest.mark.parametrize("field", ["drivers alone", "urdf", "link", "image", "relative image"])
def test_nothing_outside_is_reached(tmp_path: Path, field: str) -> None:
    """No call connects, what the field names is never opened, and who needs it refuses the cell in a line."""
    outside = tmp_path / "secrets" / "outside.urdf"
    outside.parent.mkdir()
    outside.write_text(made("joints").urdfs["eye.urdf"])
    _hostile(tmp_path / "cell", outside, field)
    for verb, *words in _VERBS:
        command = [sys.executable, "-m", "basecal", verb, str(tmp_path / "cell"), *words]
        tracer = ["strace", "-f", "-qq", "-o", str(tmp_path / "trace"), "-e", "trace=connect,sendto,openat,open"]
        ended = subprocess.run([*tracer, *command], capture_output=True, text=True, cwd=tmp_path / "cell", check=False)
        trace = (tmp_path / "trace").read_text()
        refuses = verb == "calibrate" and field != "drivers alone"
        assert ended.returncode in ((3, 4) if refuses else (2, 3) if verb == "capture" else (0, 1, 2, 3, 4)), (
            ended.stderr
        )
        assert ended.returncode not in (2, 3) or ended.stderr.count("\n") == 1, ended.stderr
        assert not _CONNECTED.search(trace), verb
        assert "outside.urdf" not in "".join(line for line in trace.splitlines() if "ENOENT" not in line), verb
