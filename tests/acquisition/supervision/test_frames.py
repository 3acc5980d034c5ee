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
