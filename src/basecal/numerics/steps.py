"""Generators run side by side: what they yield at a time is answered as one batch."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any, TypeVar

Wanted = TypeVar("Wanted")
Answer = TypeVar("Answer")
Result = TypeVar("Result")


def run_in_step(
    tasks: Sequence[Generator[Wanted, Answer, Result]], answer_all: Callable[[list[Wanted]], Iterable[Answer]]
) -> list[Result]:
    """Results of generators; `answer_all` gives the answers to what those that have not ended yield."""
    results: dict[int, Result] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(tasks)))
    while answers:
        wanted: dict[int, Wanted] = {}
        for number, answer in answers.items():
            try:
                wanted[number] = tasks[number].send(answer)  # None begins it
            except StopIteration as end:
                results[number] = end.value
        answers = dict(zip(wanted, answer_all(list(wanted.values())), strict=True)) if wanted else {}
    return [results[number] for number in range(len(tasks))]
