"""Readers of untrusted files in this process: to start their own takes longer than most of what they read in tests."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from unittest.mock import patch

from basecal import box
from basecal.exchange import lerobot, lerobot_films
from basecal.exchange.bags import bag


def _frames_here(module: str, words: Sequence[str], size: int) -> Iterator[box.Frame]:
    """As `box.frames`, by the same bytes, without limits."""
    stream = io.BytesIO()
    with warnings.catch_warnings(), patch.dict(os.environ), patch.object(box, "limit", lambda *given: None):
        warnings.simplefilter("ignore")
        box._answer(module, 0, box._LEAST_BYTES, words, stream)
    stream.seek(0)
    while (frame := box._read(stream)) is not None:
        yield frame


@contextmanager
def boxed_here() -> Iterator[None]:
    """What reads bags and datasets does so in this process."""
    with (
        patch.object(bag, "frames", _frames_here),
        patch.object(lerobot, "frames", _frames_here),
        patch.object(lerobot_films, "frames", _frames_here),
    ):
        yield
