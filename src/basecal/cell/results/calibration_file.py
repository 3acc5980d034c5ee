"""`runs/<UTC time>/calibration.json`: each calibration result in its own folder."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

from basecal.cell.calibration import Calibration
from basecal.cell.cell import Cell
from basecal.cell.format.paths import own_file
from basecal.cell.format.writing import make_timed_folder, write_atomically
from basecal.cell.format.yaml_text import read_text
from basecal.cell.journal import recording_file
from basecal.cell.results.calibration_dict import calibration_from_dict, calibration_to_dict
from basecal.cell.results.fingerprint_file import write_fingerprint
from basecal.cell.schema import cell_file
from basecal.errors import DatasetError, FrameNotFound, InputError

RUNS = "runs"
FILE = "calibration.json"
_LARGEST_BYTES = 2**28  # 256 MB: the joint covariance of 150 robots, or two million views
_RUN = re.compile(r"(\d{8}T\d{6}Z)(?:-(\d+))?")


def write_calibration(calibration: Calibration, cell_folder: str | Path) -> Path:
    """Write `calibration.json` into a new folder `runs/<UTC time>` and return its path.

    Raises:
        InputError: if the file cannot be written, or its content could not be read back.
    """
    data = calibration_to_dict(calibration)
    try:
        calibration_from_dict(data)
    except ValueError as error:
        raise InputError(f"nothing was written, since it could not be read back: {error}") from None
    text = indent_json(data)
    path = make_timed_folder(Path(cell_folder) / RUNS, Path(cell_folder)) / FILE
    write_atomically(path, text + "\n", base_folder=Path(cell_folder))
    if calibration.scene is not None:
        write_fingerprint(calibration.scene, path.parent, Path(cell_folder))
    return path


def read_calibration(path: str | Path) -> Calibration:
    """Read a calibration from a `calibration.json`, or from the folder of its run.

    Raises:
        DatasetError: if the file is missing or invalid.
    """
    file = _file(path)
    try:
        return calibration_from_dict(read_calibration_data(file))
    except DatasetError:
        raise
    except ValueError as error:
        raise DatasetError(str(file), str(error)) from None


def read_calibration_data(path: str | Path) -> Any:
    """Read the plain data of a `calibration.json`, or from the folder of its run, without validation.

    Raises:
        DatasetError: if the file cannot be read or is not JSON.
    """
    file = _file(path)
    text = read_text(file, "calibrate first, or give the file or folder of a run", _LARGEST_BYTES)
    try:
        data = json.loads(text, parse_constant=_reject_constant)
        if "\\ud" in text.lower():  # only such an escape can be an unpaired surrogate
            json.dumps(data, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise DatasetError(str(file), "text has an unpaired surrogate (\\ud800 to \\udfff); calibrate again") from None
    except json.JSONDecodeError as error:
        raise DatasetError(str(file), f"not JSON ({error.msg}); calibrate again", error.lineno) from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise DatasetError(str(file), reason) from None
    return data


def _file(path: str | Path) -> Path:
    return Path(path) / FILE if Path(path).is_dir() else Path(path)


def _reject_constant(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON; calibrate again")


def latest_run(folder: str | Path) -> Path | None:
    """Folder of a cell's most recently written run; None if there is none.

    Runs are ordered by the modification time of `calibration.json`, then by name.
    """
    runs = _runs_by_time(folder)
    return runs[0] if runs else None


def run_names(folder: str | Path) -> tuple[str, ...]:
    """Names of a cell's runs, the most recent first."""
    return tuple(run.name for run in _runs_by_time(folder))


def _runs_by_time(folder: str | Path) -> list[Path]:
    """Folders of a cell's runs, the most recent first."""
    matches = [(match, run) for run in _runs(folder) if (match := _RUN.fullmatch(run.name))]
    written = [((run / FILE).stat().st_mtime_ns, match[1], int(match[2] or 1), run) for match, run in matches]
    return [run for *_, run in sorted(written, reverse=True)]


def _runs(folder: str | Path) -> list[Path]:
    """Folders of a cell's runs that have a calibration.

    Raises:
        DatasetError: if a run is a link that leads out of the cell.
    """
    runs = own_file(folder, RUNS)
    return [own_file(folder, f"{RUNS}/{run.name}/{FILE}").parent for run in runs.glob("*") if (run / FILE).is_file()]


def run_folder(folder: str | Path, name: str) -> Path:
    """Folder of a cell's run with the given name.

    Raises:
        FrameNotFound: if there is no such run.
        DatasetError: if a run is a link that leads out of the cell.
    """
    runs = {run.name: run for run in _runs(folder)}
    if name not in runs:
        raise FrameNotFound(name, sorted(runs))
    return runs[name]


def input_hashes(folder: str | Path, cell: Cell | None = None) -> dict[str, str]:
    """Hashes `sha256:...` of a calibration's existing input files, by path in the cell.

    Args:
        folder: The cell's folder.
        cell: The cell, to include the URDF files of its robots; None to leave them out.

    Raises:
        DatasetError: if a file cannot be read.
    """
    urdfs = [robot.urdf for robot in cell.robots.values() if robot.urdf] if cell else []
    names = [cell_file.FILE, f"{recording_file.FOLDER}/{recording_file.FILE}", *sorted(set(urdfs))]
    hashes = {}
    for name, path in ((name, own_file(folder, name)) for name in names):
        if not path.is_file():
            continue
        try:
            with path.open("rb") as file:
                hashes[name] = f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"
        except OSError as error:
            raise DatasetError(str(path), f"cannot be read: {error.strerror}") from None
    return hashes


def indent_json(value: Any, level: int = 0) -> str:
    """Format plain data as JSON, indented by one space per level; an innermost list or mapping is one line.

    Raises:
        ValueError: if a number is not finite.
    """
    parts = list(value.values() if isinstance(value, dict) else value) if isinstance(value, dict | list) else []
    if {dict, list}.isdisjoint(map(type, parts)):
        return json.dumps(value, allow_nan=False)
    inner, outer = "\n" + " " * (level + 1), "\n" + " " * level
    texts = [indent_json(part, level + 1) for part in parts]
    if isinstance(value, dict):
        named = (f"{json.dumps(key)}: {text}" for key, text in zip(value, texts, strict=True))
        return "{" + inner + ("," + inner).join(named) + outer + "}"
    return "[" + inner + ("," + inner).join(texts) + outer + "]"
