"""Sessions of drivers with peers that lie, and that a session that ends as none may is found."""

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
from torment.outcome import Fell
from torment.sessions import SESSIONS, by_seed

# Seeds that once fell: a crash of ur-rtde, its own words on stderr, those of FFmpeg, a silent cell
FOUND = [("driver ur", seed) for seed in (0, 4, 5)] + [("driver opencv", seed) for seed in (0, 1, 2, 3)]
FOUND += [("driver simulated, peer", seed) for seed in (0, 1)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), FOUND)
def test_what_fell_stands(name: str, seed: int) -> None:
    """Sessions that were found by their seed."""
    needed({"driver ur": "rtde_receive"}.get(name, "cv2"), "ur")
    assert by_seed(name, seed)[0].what != "fell"


@pytest.mark.slow
@pytest.mark.parametrize("name", SESSIONS)
def test_sessions_stand(name: str) -> None:
    """Six of each driver, at once."""
    row = sessions.sessions(name, 100, 6, 6)
    assert "fell" not in row.came, row.seeds


def said(fault: str, after: int) -> bytes:
    """What comes through a link in a tenth of a second."""
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
def test_what_comes_before_the_fault_is_as_it_was(fault: str) -> None:
    """So that a device speaks its protocol up to there."""
    assert said(fault, 12)[:12] == b"123456781234"[: len(said(fault, 12)[:12])]


def test_faults_do_what_they_say() -> None:
    """Nothing more, or without end."""
    assert said("cut", 8) == b"12345678"
    assert said("silent", 40) == b"12345678" * 4
    assert len(said("flood", 8)) >= 10_000


@pytest.mark.parametrize(
    ("code", "words"),
    [(70, "basecal: error: x\n"), (-6, ""), (3, "terminate called\nbasecal: error: x\n"), (3, ""), (0, "noise\n")],
)
def test_what_no_session_may_say(code: int, words: str) -> None:
    """A fault of the program, a crash, words of a library, no word at all."""
    with pytest.raises(Fell):
        sessions._judged(code, words)
    assert sessions._judged(3, "c connects to d\nbasecal: error: x\n") == "refused"


def test_what_counts_as_interrupted() -> None:
    """130, after an interrupt: an answer after one is none, and nothing ends so by itself."""
    said = "basecal: error: interrupted\n"
    assert sessions._judged(130, said, is_interrupted=True) == "interrupted"
    for code, words, is_interrupted in ((130, said, False), (0, "", True), (3, "basecal: error: x\n", True)):
        with pytest.raises(Fell):
            sessions._judged(code, words, is_interrupted)


def _pause(seconds: float) -> None:
    time.sleep(seconds)


def test_a_session_is_interrupted_after_its_report(tmp_path: Path) -> None:
    """Never before, and not if it ended without one or too early; one that does not end is killed."""
    said, context = tmp_path / "said", multiprocessing.get_context("fork")
    short, long = (context.Process(target=_pause, args=(seconds,)) for seconds in (0.05, 60.0))
    short.start()
    assert not sessions._runs_until(short, said, 0.0)
    long.start()
    assert not sessions._reports(long.pid or 0, said)
    said.write_text("c connects to d\n")
    assert sessions._runs_until(long, said, 0.0)
    with pytest.raises(Fell, match="does not end within"):
        sessions._exit_code(long, 0.01)
    assert not long.is_alive()


def test_each_stage_gives_words(tmp_path: Path) -> None:
    """Of a driver that is measured, in a folder of its own."""
    with devices.opencv_stage(Random(3), tmp_path) as words:
        assert words[:2] == ["driver", "check"]
        assert (tmp_path / "cell" / "cell.yaml").is_file()
