"""Tests of BLAS threads in a library call.

Each runs in its own process, because the number is read when NumPy is loaded.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

_PROGRAM = """
import json
import numpy
from threadpoolctl import threadpool_info
from basecal.numerics.threads import limit_threads

def most_threads():
    return max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

print(json.dumps([most_threads(), limit_threads(most_threads)(), most_threads()]))
"""


def _threads(**stated: str) -> list[int]:
    """The number of threads before, in and after a decorated function."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")} | stated
    done = subprocess.run([sys.executable, "-c", _PROGRAM], env=environment, capture_output=True, check=True, text=True)
    found: list[int] = json.loads(done.stdout)
    return found


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one thread anyway")
def test_library_call_is_limited_to_one_thread() -> None:
    """A library call limits BLAS to one thread and restores the number afterwards."""
    before, within, after = _threads()
    assert before == after > 1
    assert within == 1


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one thread anyway")
def test_stated_number_of_threads_is_kept() -> None:
    """A number of threads that the environment states is kept."""
    assert _threads(OPENBLAS_NUM_THREADS="2") == [2, 2, 2]
