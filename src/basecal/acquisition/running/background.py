"""The running check in a separate thread: the capture continues while samples are checked."""

from __future__ import annotations

from concurrent.futures import Future
from concurrent.futures import TimeoutError as Unfinished
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Thread
from time import monotonic
from types import TracebackType

from basecal.acquisition.running.check import Doubt, RunningCheck
from basecal.cell import Cell, Sample

_PATIENCE_S = 0.3  # a check usually takes 0.2 s: waiting for it lets a sample be repeated before the arms leave


@dataclass(frozen=True)
class Checked:
    """Results of the check since the last query.

    Attributes:
        sigma: 3-D norms of the requested transform's sigmas [m] and [rad]; None if unobservable.
        doubts: Disagreements that were not reported before.
        unchecked: Number of queued samples whose check has not ended; the sigma does not include them.
    """

    sigma: tuple[float, float] | None = None
    doubts: tuple[Doubt, ...] = ()
    unchecked: int = 0


class BackgroundCheck:
    """Check of samples one after another in a daemon thread."""

    def __init__(self, cell: Cell) -> None:
        self._check = RunningCheck(cell)
        self._waiting: SimpleQueue[tuple[Sample, Future[Checked]] | None] = SimpleQueue()
        self._running: list[Future[Checked]] = []
        self._sigma: tuple[float, float] | None = None
        Thread(target=self._work, name="running-check", daemon=True).start()

    def __enter__(self) -> BackgroundCheck:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for future in self._running:
            future.cancel()
        self._waiting.put(None)

    def add(self, sample: Sample) -> None:
        """Queue a sample for the check."""
        future: Future[Checked] = Future()
        self._running.append(future)
        self._waiting.put((sample, future))

    def collect(self, waits: bool = False) -> Checked:
        """The results so far, after a short timeout; of all queued samples if `waits` is True."""
        doubts: list[Doubt] = []
        until = monotonic() + _PATIENCE_S
        while self._running:
            try:
                checked = self._running[0].result(None if waits else max(until - monotonic(), 0.0))
            except Unfinished:
                break
            del self._running[0]
            self._sigma = checked.sigma
            doubts += checked.doubts
        return Checked(self._sigma, tuple(doubts), len(self._running))

    def _work(self) -> None:
        """Check queued samples until the queue is closed."""
        while (wanted := self._waiting.get()) is not None:
            sample, future = wanted
            if not future.set_running_or_notify_cancel():
                continue
            try:
                doubts = self._check.add(sample)
                estimate = self._check.estimate
                future.set_result(Checked(None if estimate is None else estimate.sigma, doubts))
            except Exception as error:  # raised again in `collect`
                future.set_exception(error)
