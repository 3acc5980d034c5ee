"""Tests of framed messages between processes."""

from __future__ import annotations

import os

import numpy as np
import pytest

from basecal.acquisition.supervision import frames
from basecal.acquisition.supervision.frames import Channel, Frame, Kind


@pytest.fixture
def pair():
    """Two channels linked in both directions."""
    here_read, there_write = os.pipe()
    there_read, here_write = os.pipe()
    pair = Channel(here_read, here_write), Channel(there_read, there_write)
    yield pair
    for channel in pair:
        channel.close()


def test_frames_arrive_complete_and_in_order(pair):
    """They may have any length and be split by the system."""
    here, there = pair
    rng = np.random.default_rng(0)
    sent = [Frame(Kind.READING, k % 3, rng.bytes(int(rng.integers(0, 200_000)))) for k in range(12)]
    for frame in sent:
        here.send(Kind.READING, frame.payload, frame.arm)
    received = []
    while len(received) < len(sent):
        received += there.receive()
        here.flush()
    assert received == sent


def test_sender_does_not_wait_for_a_reader(pair, monkeypatch):
    """Unread data are kept up to a limit; beyond it the link counts as broken, and sending still returns."""
    monkeypatch.setattr(frames, "_FULL_BUFFER_BYTES", 2**20)
    here, _ = pair
    for _ in range(40):
        here.send(Kind.READING, bytes(2**16))
    assert here.is_broken
    here.send(Kind.STOP)


@pytest.mark.parametrize(("unsent_bytes", "is_broken"), [(2**22 - 2**17, False), (2**22 + 2**17, True)])
def test_reader_may_be_four_mebibytes_behind(pair, unsent_bytes, is_broken):
    """Below the limit all data arrive; above it the other process counts as hanging."""
    here, there = pair
    here.send(Kind.READING, bytes(unsent_bytes))
    assert here.is_broken == is_broken
    here.flush()
    assert here.is_broken == is_broken
    frames_read = []
    while not is_broken and not frames_read:
        frames_read = there.receive()
        here.flush()
    assert [len(frame.payload) for frame in frames_read] == [unsent_bytes][: not is_broken]


def test_frame_arrives_with_its_last_byte(pair):
    """A frame without payload is its header; a partial header or payload waits for the rest."""
    here, there = pair
    here.send(Kind.STOP)
    assert there.receive() == [Frame(Kind.STOP, 0, b"")]
    here.send(Kind.TROUBLE, b"why", arm=2)
    whole = os.read(there.read_fd, 100)
    for first in (0, 1, 5, 6, 8):
        os.write(here._write_fd, whole[:first])
        assert there.receive() == []
        os.write(here._write_fd, whole[first:])
        assert there.receive() == [Frame(Kind.TROUBLE, 2, b"why")]


def test_link_without_a_reader_is_broken(pair):
    """Sending into it returns silently."""
    here, there = pair
    there.close()
    assert not here.is_broken
    here.send(Kind.ALIVE)
    assert here.is_broken


def test_closed_link_releases_its_descriptors(pair):
    """Both are released, or the shared one; a second close has no effect."""
    here, there = pair
    for _ in range(2):
        here.close()
        assert here.is_broken
    for fd in (here.read_fd, here._write_fd):
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(fd)
    with pytest.raises(EOFError):
        here.receive()
    assert os.read(there.read_fd, 1) == b""


def test_end_comes_after_sent_frames(pair):
    """Frames that arrived before the end are returned; then EOFError is raised, and sending has no effect."""
    here, there = pair
    here.send(Kind.TROUBLE, b"why")
    here.close()
    assert there.receive() == [Frame(Kind.TROUBLE, 0, b"why")]
    with pytest.raises(EOFError):
        there.receive()
    there.send(Kind.ALIVE)
    assert there.is_broken
