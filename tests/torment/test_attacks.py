"""Tests of attacks that once succeeded, by command lines and files that anyone may send."""

from __future__ import annotations

import copy
import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree
from typing import Any
from xml.dom import minidom

import numpy as np
import pytest
from ruamel.yaml import YAML

from basecal.cell.files import latest_run
from basecal.cli import main
from shared.needed import needed
from torment.cells import cell_text, made, write

_MOST_S = 10.0  # of a refusal, beside other programs
_SECRET = "AWS_SECRET_ACCESS_KEY"
_EVIL = "x\n  points:\n  - {positions: [3], time_from_start: {sec: 0, nanosec: 1}}"


@pytest.fixture
def stranger() -> Iterator[socket.socket]:
    """Foreign server that must get no connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        yield server
        with pytest.raises(BlockingIOError):
            server.accept()


def _cell(folder: Path, kind: str = "pose") -> Path:
    copytree(made(kind).folder, folder / "cell")
    return folder / "cell"


def _driven(folder: Path, section: str, driver: dict[str, Any]) -> Path:
    """Cell whose arm or camera has a driver."""
    cell, described = _cell(folder), copy.deepcopy(made("pose").cell)
    next(iter(described[section].values()))["driver"] = driver
    (cell / "cell.yaml").write_text(cell_text(described))
    return cell


def _refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a command refuses, soon."""
    begin = time.monotonic()
    assert main(words) in (2, 3)
    assert time.monotonic() - begin < _MOST_S
    said = capsys.readouterr().err
    assert said.splitlines()[-1].startswith("basecal: error: ")
    assert len(said) < 2500
    return said


def test_1_a_cell_sends_no_secret(
    tmp_path: Path, stranger: socket.socket, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`capture` connects to no server named by a cell, and never sends it another program's variable."""
    monkeypatch.setenv(_SECRET, "do not tell")
    url = f"opc.tcp://127.0.0.1:{stranger.getsockname()[1]}"
    driver = {"kind": "opcua", "url": url, "joints": ["a"], "unit": "rad", "user": "me", "password_in": _SECRET}
    cell = _driven(tmp_path, "robots", driver)
    for more in ([], ["--go"], ["--yes"], ["--yes", "--go"]):
        assert "do not tell" not in _refused(["capture", str(cell), *more], capsys)


@pytest.mark.slow
def test_2_names_of_a_urdf_plan_no_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A joint name with YAML stays a name in a trajectory, or the plan is refused."""
    cell = _cell(tmp_path, "joints")
    urdf = (cell / "eye.urdf").read_text()
    first = minidom.parseString(urdf).getElementsByTagName("joint")[0].getAttribute("name")
    (cell / "eye.urdf").write_text(urdf.replace(f'"{first}"', f'"{_EVIL}"'.replace("\n", "&#10;")))
    words = ["plan", str(cell), "--samples", "1", "--task-point", "0.5", "0", "0.3"]
    for kind in ("ros2-trajectory", "csv"):
        code = main([*words, "--to", kind, "-o", str(tmp_path / "out")])
        said = capsys.readouterr().err
        assert code in (0, 3, 5), said
        if code != 3 and kind == "ros2-trajectory":
            told = [*YAML(typ="safe", pure=True).load_all((tmp_path / "out").read_text())]
            found = [point for each in told for point in _points(each)]
            assert found
            assert all(point["time_from_start"]["nanosec"] != 1 for point in found)


def _points(data: Any) -> Iterator[Any]:
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if key == "points":
            yield from value
        else:
            yield from _points(value)


@pytest.mark.parametrize("suffix", [".mcap", ".db3", ".bag"])
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_3_a_bag_that_is_no_file(tmp_path: Path, suffix: str, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A pipe does not block, and /dev/zero fills no memory."""
    bag = tmp_path / f"a{suffix}"
    os.mkfifo(bag) if kind == "pipe" else bag.symlink_to("/dev/zero")
    needed("rosbags", "bags")
    said = _refused(["import", "bag", str(tmp_path / "cell"), str(bag), "--robot", "arm=/arm/pose"], capsys)
    assert "is not a file but a pipe, a device" in said


def test_5_an_import_copies_no_other_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files listed by another program, targets of links, and sparse files are not copied."""
    secret, data = tmp_path / "id_rsa", tmp_path / "data"
    secret.write_text("private")
    data.mkdir()
    pose = {"x": 0.1, "y": 0.2, "z": 0.3, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
    (data / "0.yaml").write_text(json.dumps(pose))
    for image in (str(secret), "../id_rsa"):
        (data / "list.yaml").write_text(json.dumps({"data": [{"image": image, "pose": "0.yaml"}]}))
        words = ["import", "industrial-calibration", str(tmp_path / "cell"), str(data / "list.yaml")]
        _refused([*words, "--camera-on", "robot"], capsys)
    photos, cell = tmp_path / "photos", _cell(tmp_path / "own")
    photos.mkdir()
    (photos / "0.png").symlink_to(secret)
    _refused(["import", "images", str(cell), str(photos), "--camera", "wrist", "--session"], capsys)
    (photos / "0.png").unlink()
    with (photos / "0.png").open("wb") as file:
        file.truncate(2**34)
    _refused(["import", "images", str(cell), str(photos), "--camera", "wrist", "--session"], capsys)
    assert not any(b"private" in path.read_bytes() for path in cell.rglob("*") if path.is_file())
    assert sum(path.stat().st_size for path in cell.rglob("*") if path.is_file()) < 2**22


def test_6_comment_of_an_export_cannot_be_closed_by_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A key of `inputs` that closes a comment adds no element to URDF and MJCF."""
    cell = _cell(tmp_path, "joints")
    run = latest_run(cell)
    assert run is not None
    data = json.loads((run / "calibration.json").read_text())
    before = _elements(cell, capsys)
    data["inputs"]["---><plugin name='x' filename='evil.so'/><!--"] = "0" * 64
    (run / "calibration.json").write_text(json.dumps(data))
    assert _elements(cell, capsys) == before


def _elements(cell: Path, capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    found = []
    for kind in ("urdf_cell", "mujoco"):
        assert main(["export", str(cell), "--to", kind]) == 0
        read = minidom.parseString(capsys.readouterr().out.strip().encode())
        found.append([each.tagName for each in read.getElementsByTagName("*")])
    return found


@pytest.mark.parametrize("scheme", ["http", "rtsp", "udp"])
def test_7_a_cell_fetches_no_image(
    tmp_path: Path, scheme: str, stranger: socket.socket, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without confirmation `capture` opens no address named by a camera, and waits for none."""
    source = f"{scheme}://127.0.0.1:{stranger.getsockname()[1]}/x"
    _refused(["capture", str(_driven(tmp_path, "cameras", {"kind": "opencv", "source": source}))], capsys)


@pytest.mark.slow
def test_8_sigmas_that_differ_by_decades(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Views whose sigmas differ by 1e11 yield an answer or a refusal, also if the base is unobservable."""
    for kind, field, task in (("charuco", "sigma_px", ()), ("led", "", ("--task-point", "0.5", "0.1", "0.3"))):
        samples = copy.deepcopy(made(kind).samples)
        for k, sample in enumerate(samples):
            for seen in sample["observations"] if field else ():
                seen[field] = 10.0 ** (k % 3 * 5.5 - 8)
            sample["robots"]["eye"] = samples[0]["robots"]["eye"] if task else sample["robots"]["eye"]
        folder = tmp_path / kind
        folder.mkdir()
        write(folder, made(kind).cell, samples, made(kind).urdfs)
        assert main(["calibrate", str(folder), "--json", *task]) in (0, 1, 3, 4)
        capsys.readouterr()


def test_12_invalid_numbers_and_unknown_fields_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`1_0` is not ten, an unknown field is refused, and a name of 20 kB causes no line of 20 kB."""
    (tmp_path / "poses.csv").write_text("x,y,z,qx,qy,qz,qw\n1_0,0,0,0,0,0,1\n")
    words = ["import", "poses", str(tmp_path / "new"), "--robot", "eye", str(tmp_path / "poses.csv")]
    assert "1_0" in _refused([*words, "--length-unit", "m"], capsys)
    cell = _cell(tmp_path)
    run = latest_run(cell)
    assert run is not None
    path = run / "calibration.json"
    data = json.loads(path.read_text())
    for name in ("nobody_knows", "x" * 20_000):
        path.write_text(json.dumps({**data, name: 1}))
        _refused(["export", str(cell), "--to", "json"], capsys)


@pytest.mark.slow
def test_4_run_lengths_are_counted_before_they_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table of a few kilobytes with more rows than any recording is refused before it is read."""
    needed("pyarrow", "lerobot")
    import pyarrow as pa
    import pyarrow.parquet as pq

    (tmp_path / "meta").mkdir()
    (tmp_path / "data").mkdir()
    features = {"features": {"observation.state": {"names": ["a.pos", "b.pos"]}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(features))
    rows = 2**20
    states = pa.ListArray.from_arrays(np.arange(0, 2 * rows + 1, 2, dtype=np.int32), np.zeros(2 * rows, np.float32))
    columns = [states, np.zeros(rows, np.float32), np.zeros(rows, np.int64)]
    table = pa.table(columns, names=["observation.state", "timestamp", "episode_index"])
    with pq.ParquetWriter(tmp_path / "data" / "a.parquet", table.schema, compression="zstd") as writer:
        for _ in range(20):
            writer.write_table(table)
    words = [
        "import",
        "lerobot",
        str(_cell(tmp_path / "own", "joints")),
        str(tmp_path),
        "--robot",
        "eye",
        "--unit",
        "rad",
    ]
    assert "has more than 20000000 rows" in _refused(words, capsys)
