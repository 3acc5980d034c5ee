"""Framed messages between processes."""

from __future__ import annotations

import os

import numpy as np
import pytest

from basecal.acquisition.supervision import frames
from basecal.acquisition.supervision.frames import Channel, Frame, Kind


@pytest.fixture
def pair():
    """Two channels that are linked both ways."""
    here_read, there_write = os.pipe()
    there_read, here_write = os.pipe()
    pair = Channel(here_read, here_write), Channel(there_read, there_write)
    yield pair
    for channel in pair:
        channel.close()


def test_frames_arrive_whole_and_in_order(pair):
    """Of any length, however the system cuts them."""
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


def test_nobody_waits_for_a_reader(pair, monkeypatch):
    """What is not read is kept, up to a limit; beyond it the link counts as broken, and sending goes on to return."""
    monkeypatch.setattr(frames, "_FULL_BUFFER_BYTES", 2**20)
    here, _ = pair
    for _ in range(40):
        here.send(Kind.READING, bytes(2**16))
    assert here.is_broken
    here.send(Kind.STOP)


@pytest.mark.parametrize(("unsent_bytes", "is_broken"), [(2**22 - 2**17, False), (2**22 + 2**17, True)])
def test_a_reader_may_be_four_mebibytes_behind(pair, unsent_bytes, is_broken):
    """Below it the link is whole and all of it arrives; above it the other process counts as hung."""
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


def test_a_frame_arrives_with_its_last_byte(pair):
    """A frame without payload is its header alone; a part of a header or of a payload waits for the rest."""
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


def test_a_link_whose_reader_has_gone_is_broken(pair):
    """Sending into it returns, and says nothing."""
    here, there = pair
    there.close()
    assert not here.is_broken
    here.send(Kind.ALIVE)
    assert here.is_broken


def test_a_closed_link_gives_its_descriptors_back(pair):
    """Both of them, or the one that serves both ways; to close it again does nothing."""
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


def test_the_end_is_told_after_what_was_sent(pair):
    """Frames that arrived before the other side ended are given; then it is the end, and sending does nothing."""
    here, there = pair
    here.send(Kind.TROUBLE, b"why")
    here.close()
    assert there.receive() == [Frame(Kind.TROUBLE, 0, b"why")]
    with pytest.raises(EOFError):
        there.receive()
    there.send(Kind.ALIVE)
    assert there.is_broken
