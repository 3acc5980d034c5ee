"""Tests of sessions of drivers with faulty peers; forbidden ends are found."""

from __future__ import annotations

import multiprocessing
import socket
import time
from pathlib import Path
from random import Random

import pytest

from shared.needed import needed
from torment import devices, sessions
from torment.faulty_link import FAULTS, FaultyLink, linked, played
from torment.outcome import TrialFailed
from torment.sessions import SESSIONS, by_seed

# Seeds that once failed: a crash of ur-rtde, its own words on stderr, those of FFmpeg, a silent cell
FOUND = [("driver ur", seed) for seed in (0, 4, 5)] + [("driver opencv", seed) for seed in (0, 1, 2, 3)]
FOUND += [("driver simulated, peer", seed) for seed in (0, 1)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), FOUND)
def test_earlier_failures_are_fixed(name: str, seed: int) -> None:
    """These sessions failed once, and are repeated by their seed."""
    needed({"driver ur": "rtde_receive"}.get(name, "cv2"), "ur")
    assert by_seed(name, seed)[0].what != "failed"


@pytest.mark.slow
@pytest.mark.parametrize("name", SESSIONS)
def test_sessions_end_as_allowed(name: str) -> None:
    """Six sessions of each driver run at once."""
    row = sessions.sessions(name, 100, 6, 6)
    assert "failed" not in row.came, row.seeds


def said(fault: str, after: int) -> bytes:
    """Data received through a link in a tenth of a second."""
    link = FaultyLink(fault, after, Random(1))
    with (
        linked(link, [played(lambda line: line.sendall(b"12345678" * 4))], [("127.0.0.1", 0)]) as (port,),
        socket.create_connection(("127.0.0.1", port), timeout=0.1) as line,
    ):
        found = b""
        try:
            while len(found) < 10_000 and (data := line.recv(1000)):
                found += data
        except OSError:
            pass
    return found


@pytest.mark.parametrize("fault", FAULTS)
def test_data_before_the_fault_are_unchanged(fault: str) -> None:
    """The device speaks its protocol up to the fault."""
    assert said(fault, 12)[:12] == b"123456781234"[: len(said(fault, 12)[:12])]


def test_faults_act_as_named() -> None:
    """They end or repeat the data as named."""
    assert said("cut", 8) == b"12345678"
    assert said("silent", 40) == b"12345678" * 4
    assert len(said("flood", 8)) >= 10_000


@pytest.mark.parametrize(
    ("code", "words"),
    [(70, "basecal: error: x\n"), (-6, ""), (3, "terminate called\nbasecal: error: x\n"), (3, ""), (0, "noise\n")],
)
def test_forbidden_ends_of_sessions_are_found(code: int, words: str) -> None:
    """Internal faults, crashes, raw messages of a library, and silence are found."""
    with pytest.raises(TrialFailed):
        sessions._judged(code, words)
    assert sessions._judged(3, "c connects to d\nbasecal: error: x\n") == "refused"


def test_interrupted_session_exits_with_code_130() -> None:
    """The code must follow an interrupt: an answer after one, or the code without one, is a failure."""
    said = "basecal: error: interrupted\n"
    assert sessions._judged(130, said, is_interrupted=True) == "interrupted"
    for code, words, is_interrupted in ((130, said, False), (0, "", True), (3, "basecal: error: x\n", True)):
        with pytest.raises(TrialFailed):
            sessions._judged(code, words, is_interrupted)


def _pause(seconds: float) -> None:
    time.sleep(seconds)


def test_session_is_interrupted_after_its_report(tmp_path: Path) -> None:
    """Never before, and not if it ended early or without a report; one that does not end is killed."""
    said, context = tmp_path / "said", multiprocessing.get_context("fork")
    short, long = (context.Process(target=_pause, args=(seconds,)) for seconds in (0.05, 60.0))
    short.start()
    assert not sessions._runs_until(short, said, 0.0)
    long.start()
    assert not sessions._reports(long.pid or 0, said)
    said.write_text("c connects to d\n")
    assert sessions._runs_until(long, said, 0.0)
    with pytest.raises(TrialFailed, match="does not end within"):
        sessions._exit_code(long, 0.01)
    assert not long.is_alive()


def test_each_stage_yields_arguments(tmp_path: Path) -> None:
    """The driver check runs in its own folder."""
    with devices.opencv_stage(Random(3), tmp_path) as words:
        assert words[:2] == ["driver", "check"]
        assert (tmp_path / "cell" / "cell.yaml").is_file()
