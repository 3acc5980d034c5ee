"""Run generators in lockstep: the requests that they yield are answered as one batch."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any, TypeVar

Request = TypeVar("Request")
Answer = TypeVar("Answer")
Result = TypeVar("Result")


def run_in_step(
    tasks: Sequence[Generator[Request, Answer, Result]], answer_all: Callable[[list[Request]], Iterable[Answer]]
) -> list[Result]:
    """Run generators to their ends and return their results; `answer_all` answers all requests of one step."""
    results: dict[int, Result] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(tasks)))
    while answers:
        requests: dict[int, Request] = {}
        for number, answer in answers.items():
            try:
                requests[number] = tasks[number].send(answer)  # None starts the generator
            except StopIteration as end:
                results[number] = end.value
        answers = dict(zip(requests, answer_all(list(requests.values())), strict=True)) if requests else {}
    return [results[number] for number in range(len(tasks))]
