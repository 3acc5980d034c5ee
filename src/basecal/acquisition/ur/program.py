"""The program of ur-rtde, which runs on a UR controller while it is moved or led."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from basecal.acquisition.reach import reached
from basecal.acquisition.ur.options import UrOptions, in_a_line
from basecal.errors import DriverError

_NEEDED = {29999: "the dashboard of a UR", 30003: "a UR that takes programs"}

Given = TypeVar("Given")


class Program:
    """The program; it is sent when it is first asked for something, and again when it was lost."""

    def __init__(self, name: str, options: UrOptions) -> None:
        self._name, self._options = name, options
        self._line: Any = None

    @property
    def was_asked(self) -> bool:
        """Whether it was ever sent."""
        return self._line is not None

    def ask(self, what: Callable[[Any], Given]) -> Given:
        """What it answers.

        Args:
            what: A question to ur-rtde's `RTDEControlInterface`.

        Raises:
            DriverError: if it cannot be started, or was stopped.
        """
        try:
            if self._line is None or not (self._line.isConnected() and self._line.isProgramRunning()):
                self._line = self._started()
            return what(self._line)
        except (RuntimeError, ValueError) as error:
            said = in_a_line(error)
            if "remote control" in said:
                said = "no permission to move: choose remote control on the pendant, then start again"
            raise DriverError(f"{self._name}: {said}") from None

    def _started(self) -> Any:
        from rtde_control import RTDEControlInterface

        for port, what in _NEEDED.items():
            reached(self._name, self._options.host, port, what).close()
        return RTDEControlInterface(self._options.host, self._options.rate_hz)

    def close(self) -> None:
        """End it on the controller, and hang up."""
        if self._line is not None:
            with suppress(RuntimeError):
                self._line.stopScript()
                self._line.disconnect()
