"""Run generators in lockstep: the requests that they yield are answered as one batch."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any, TypeVar

Wanted = TypeVar("Wanted")
Answer = TypeVar("Answer")
Result = TypeVar("Result")


def run_in_step(
    tasks: Sequence[Generator[Wanted, Answer, Result]], answer_all: Callable[[list[Wanted]], Iterable[Answer]]
) -> list[Result]:
    """Run generators to their ends and return their results; `answer_all` answers all requests of one step."""
    results: dict[int, Result] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(tasks)))
    while answers:
        wanted: dict[int, Wanted] = {}
        for number, answer in answers.items():
            try:
                wanted[number] = tasks[number].send(answer)  # None starts the generator
            except StopIteration as end:
                results[number] = end.value
        answers = dict(zip(wanted, answer_all(list(wanted.values())), strict=True)) if wanted else {}
    return [results[number] for number in range(len(tasks))]
