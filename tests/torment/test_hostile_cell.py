"""Tests of a cell whose fields all point outside, under a tracer: no connection, and no file outside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from basecal.exchange.exporters.registry import EXPORTERS
from torment import hostile_cell
from torment.hostile_cell import VERBS, Lure, harmless, lures, reached
from torment.outcome import TrialFailed
from torment.system_calls import is_possible

pytestmark = pytest.mark.skipif(not is_possible(), reason="needs strace, and leave to hold others")

_IMAGE = (0, "images", "wrist")
_FIELDS: dict[str, Callable[[Path], Lure]] = {
    "urdf": lambda outside: Lure("cell.yaml", ("robots", "eye", "urdf"), str(outside)),
    "link": lambda outside: Lure("eye.urdf", (), ""),
    "image": lambda outside: Lure("recording/samples.jsonl", _IMAGE, str(outside)),
    "relative image": lambda outside: Lure("recording/samples.jsonl", _IMAGE, "../../outside/eye.urdf"),
}
_SLOW = ("plan", "fix", "study", "demo", "new", "simulate", *(f"export {kind}" for kind in EXPORTERS if kind != "json"))


@pytest.mark.slow
@pytest.mark.parametrize("field", _FIELDS)
def test_no_file_or_host_outside_is_reached(tmp_path: Path, field: str) -> None:
    """No call connects, no named file is opened, and verbs that need one refuse the cell."""
    lure = _FIELDS[field](tmp_path / "calibrate" / "outside" / "eye.urdf")
    for verb in VERBS.keys() - set(_SLOW):
        (tmp_path / verb).mkdir()
        code, found = reached(verb, tmp_path / verb, lure)
        assert not found - harmless(verb), verb
        assert code in ((2, 3, 4) if verb in ("calibrate", "detect") else (0, 1, 2, 3, 4)), verb


def test_access_to_the_outside_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A verb that opens a named file, or connects, fails; one that only tests its existence does not."""
    monkeypatch.setattr(hostile_cell, "harmless", lambda verb: frozenset())
    lure = _FIELDS["relative image"](tmp_path)
    for name, message in (("open_outside", r"openat .*outside/eye"), ("connect", "connect")):
        (tmp_path / name).mkdir()
        monkeypatch.setattr(hostile_cell, "MAIN", f"torment.trespassers:{name}")
        with pytest.raises(TrialFailed, match=message):
            hostile_cell._try("detect", tmp_path / name, lure)
    monkeypatch.setattr(hostile_cell, "MAIN", "torment.trespassers:ask")
    (tmp_path / "ask").mkdir()
    assert hostile_cell._try("detect", tmp_path / "ask", lure) == "answered"


def test_each_lure_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Several count together if a verb answers; if it refuses or fails, each gets its own run."""
    tried: list[tuple[int, ...]] = []

    def fake(verb: str, folder: Path, *numbers: int) -> str:
        tried.append(numbers)
        if 7 in numbers:
            raise TrialFailed(f"{folder}: reached")
        return "refused" if 12 in numbers else "answered"

    monkeypatch.setattr(hostile_cell, "_is_readable", lambda number: number != 1)
    monkeypatch.setattr(hostile_cell, "_chosen", lambda folder, numbers: numbers)
    monkeypatch.setattr(hostile_cell, "_try", fake)
    row = hostile_cell.each("detect", range(40), 100)
    assert (row.first, row.end) == (100, 140)
    assert row.came == {"answered": 38, "refused": 1, "failed": 1}
    assert row.seeds == {"failed": {"107": ": reached"}}
    assert (1,) in tried
    assert (0, 5, 10, 15, 20, 25, 30, 35) in tried
    assert len(tried) < 40


def test_several_lures_are_written(tmp_path: Path) -> None:
    """Each is in its field; other fields are unchanged."""
    found = list(lures(tmp_path / "outside" / "eye.urdf", tmp_path / "cell"))
    fields = [lure for lure in found if lure.text.startswith("http") and lure.place]
    some = [next(lure for lure in fields if lure.file == file) for file in sorted({lure.file for lure in fields})]
    hostile_cell.lay(tmp_path, some)
    for lure in some:
        text = (tmp_path / "cell" / lure.file).read_text()
        assert text.count(lure.text) == 1 + (tmp_path / "twin" / lure.file).read_text().count(lure.text)


def test_every_field_has_a_lure(tmp_path: Path) -> None:
    """Texts of the cell, its samples, its run and its robots have one, and each file as a link."""
    found = list(lures(tmp_path / "outside" / "eye.urdf", tmp_path / "cell"))
    files = {lure.file.split("/")[0] for lure in found if lure.place}
    assert files == {"cell.yaml", "recording", "runs", "eye.urdf"}
    assert {"cell.yaml", "eye.urdf", "recording", "runs"} <= {lure.file for lure in found if not lure.place}
    assert sum(lure.place == ("robots", "eye", "driver", "url") for lure in found) == 5
