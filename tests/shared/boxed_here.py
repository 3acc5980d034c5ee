"""Readers of untrusted files that run in this process: in tests, starting a process takes longer than reading."""

from __future__ import annotations

import io
import math
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from types import ModuleType
from unittest.mock import patch

from basecal import box
from basecal.exchange import lerobot, workbook
from basecal.exchange.bags import bag
from basecal.exchange.importers import lerobot as lerobot_importer


def _frames_here(
    module: str, words: Sequence[str], size: int, ending_s: float = 0.0, silence_s: float = math.inf
) -> Iterator[box.Frame]:
    """The same bytes as from `box.frames`, without limits."""
    stream = io.BytesIO()
    with warnings.catch_warnings(), patch.dict(os.environ), patch.object(box, "limit", lambda *given: None):
        warnings.simplefilter("ignore")
        box._answer(module, 0, box._LEAST_OUTPUT_BYTES, words, stream)
    stream.seek(0)
    while (frame := box._read(stream)) is not None:
        yield frame


@contextmanager
def boxed_here(*modules: ModuleType) -> Iterator[None]:
    """Within the context these modules, or those of bags, datasets and workbooks, read files in this process."""
    with ExitStack() as patches:
        for module in modules or (bag, lerobot, lerobot_importer, workbook):
            patches.enter_context(patch.object(module, "frames", _frames_here))
        yield
