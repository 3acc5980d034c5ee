"""Function calls on the workers of a Dask cluster, with messages for its failures."""

from __future__ import annotations

import ctypes
import logging
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import cache, partial
from importlib import import_module
from importlib.metadata import version
from typing import Any

from basecal.errors import BasecalError, InputError, MissingExtra

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
_LARGEST_KEPT_BYTES = 2**25  # 32 MB: the upper limit of malloc's own adaptation
_PATIENCE_S = 10  # timeout of the connection to a scheduler


def call_on_cluster(address: str, calls: Sequence[partial[bytes]]) -> Iterator[tuple[int, bytes | str]]:
    """Execute calls on a cluster; yield the index and the bytes of each finished call, or why it killed its workers.

    Args:
        address: Address of a Dask scheduler, such as tcp://10.0.0.1:8786.
        calls: The calls.

    Raises:
        MissingExtra: if Dask is not installed.
        InputError: if no scheduler answers, the scheduler ends, or workers have another version of basecal.
    """
    with _client(address) as client:
        indices, suspects = {future: index for index, future in enumerate(client.map(_run_call, calls, pure=False))}, []
        for future in _dask().as_completed(list(indices)):
            outcome, index = (
                _result(future, address),
                indices.pop(future),
            )  # popped: frees the memory of yielded results
            if isinstance(outcome, str):
                suspects.append(index)
            else:
                yield index, outcome
        for index in suspects:  # a call that only waited while another call killed its worker succeeds alone
            yield index, _result(client.submit(_run_call, calls[index], pure=False), address)


def _run_call(call: partial[bytes]) -> bytes:
    _keep_memory()
    return call()


@cache
def _keep_memory() -> None:
    """Let malloc keep the memory of freed arrays, as outside of Dask.

    Dask makes its workers return memory at once (MALLOC_TRIM_THRESHOLD_), which disables malloc's own adaptation of its
    thresholds. Each array of some hundred kilobytes then needs new pages, which take as long as the computation itself.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _LARGEST_KEPT_BYTES)
        mallopt(_TRIM_THRESHOLD, 2 * _LARGEST_KEPT_BYTES)


def _result(future: Any, address: str) -> bytes | str:
    try:
        content: bytes = future.result()
    except _dask().KilledWorker:
        return "its workers were killed repeatedly: is there enough memory?"
    except CancelledError:
        raise InputError(
            f"the scheduler at {address} ended; finished results are kept: start the same command again"
        ) from None
    except ImportError as error:
        if isinstance(error, BasecalError):
            raise
        raise InputError(f"a worker lacks a package ({error}): install the same packages there as here") from None
    return content


@contextmanager
def _client(address: str) -> Iterator[Any]:
    dask = _dask()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # relevant failures are reported here
    try:
        client = dask.Client(address, timeout=_PATIENCE_S)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"no Dask scheduler answers at {address} ({reason}): start one with `dask scheduler`, give its address"
        ) from None
    with client:
        _check_workers(client)
        yield client


def _dask() -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise MissingExtra("cluster", "--scheduler") from None


def _check_workers(client: Any) -> None:
    own_version = version("basecal")
    for worker, worker_version in client.run(version, "basecal", on_error="return").items():
        if worker_version != own_version:
            installed = f"basecal {worker_version}" if isinstance(worker_version, str) else "no basecal"
            raise InputError(
                f"the worker {worker} has {installed}, here is {own_version}: install the same version there"
            )
