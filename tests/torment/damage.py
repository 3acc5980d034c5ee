"""Plain data and texts with faults in them, as broken programs, careless hands and hostile senders make them."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from random import Random
from typing import Any

Place = tuple[str | int, ...]

HOSTILE_TEXTS = (
    "",
    "\x00",
    "\x1b[2J\x1b]0;owned\x07",
    "\u202e\u2066",
    "\ud800",
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</script><!--",
    "b; touch PWNED $(touch PWNED) `touch PWNED` #",
    "'; touch PWNED '",
    "{{ 7 * 7 }} {% raw %}",
    "../../../../etc/passwd",
    "/dev/zero",
    "file:///etc/passwd",
    "-o",
    "a\nb\rc\td",
    "e\u0301" * 40,
    "x" * 5000,
    "%s %d %n {0} {!r}",
    "__proto__",
    "=cmd|' /C calc'!A0",
)
ODD_NUMBERS = (
    *(0, 1, -1, 2**31, -(2**63), 2**64, 10**400, 0.0, -0.0, 0.1, 1e-320, 1e-30, 1e-13, 1e-6, 1e3, 1e5, 999999.0),
    *(1e7, 1e155, 1e200, 1e308, -1e308, 3.141592653589793, float("nan"), float("inf"), float("-inf")),
)
ODD_VALUES = (None, True, False, [], {}, [[]], [None], {"": None}, [[1, 2], [3]], [[[[[[0]]]]]])
# By which a number is multiplied: signs, digits that slip, other units, the last bit.
_FACTORS = (-1.0, 0.0, 1 + 2e-16, 0.999, 1.01, 2.0, 10.0, 1e-3, 1e3, 57.29577951308232, 1e-12, 1e12)


def places(data: Any, here: Place = ()) -> Iterator[Place]:
    """Every place in plain data, the whole first."""
    yield here
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from places(value, (*here, key))


def at(data: Any, place: Place) -> Any:
    """What stands at a place."""
    for key in place:
        data = data[key]
    return data


def damaged(data: Any, chance: Random, faults: int = 3) -> Any:
    """A copy of plain data with one to `faults` places of it changed, removed, doubled, swapped or renamed."""
    data = copy.deepcopy(data)
    for _ in range(chance.randint(1, faults)):
        known = list(places(data))
        place = chance.choice(known)
        if not place:
            place = chance.choice(known)
        if not place:
            return _other(data, chance)
        _damage(at(data, place[:-1]), place[-1], data, known, chance)
    return data


def _damage(around: Any, key: Any, data: Any, known: list[Place], chance: Random) -> None:
    kind = chance.randrange(8)
    if kind == 0:
        del around[key]
    elif kind == 1 and isinstance(around, list):
        around.insert(chance.randrange(len(around) + 1), copy.deepcopy(around[key]))
    elif kind == 1:
        around[chance.choice(HOSTILE_TEXTS)] = around.pop(key)
    elif kind == 2:
        around[key] = copy.deepcopy(at(data, chance.choice(known)))
    elif kind == 3 and isinstance(around, list):
        chance.shuffle(around)
    else:
        around[key] = _other(around[key], chance)


def _other(value: Any, chance: Random) -> Any:
    """A value near another, or far from it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and chance.random() < 0.6:
        try:
            return value * chance.choice(_FACTORS)
        except OverflowError:
            return 0
    if isinstance(value, str) and chance.random() < 0.6:
        return torn(value, chance)
    return copy.deepcopy(chance.choice([*ODD_NUMBERS, *HOSTILE_TEXTS, *ODD_VALUES]))


def torn(text: str, chance: Random) -> str:
    """A text with a piece of it cut, doubled, or replaced by a hostile one."""
    start = chance.randrange(len(text) + 1)
    end = min(len(text), start + chance.randint(0, 4))
    piece = chance.choice(["", text[start:end] * 2, chance.choice(HOSTILE_TEXTS), chr(chance.randrange(0x250))])
    return text[:start] + piece + text[end:]


_PIECES = (b"[", b"]", b"{", b"}", b":", b"-", b"\n", b'"', b",", b"1e999", b"NaN", b"\xff", b"\0", b"null", b"true")


def torn_bytes(content: bytes, chance: Random, faults: int = 4) -> bytes:
    """Content with up to `faults` pieces of it cut, doubled, swapped or replaced, or its end missing."""
    data = bytearray(content)
    for _ in range(chance.randint(1, faults)):
        start, size = chance.randrange(len(data) + 1), chance.randint(0, 6)
        piece = chance.choice(
            [chance.choice(_PIECES), bytes([chance.randrange(256)]), bytes(data[start : start + 9]), b""]
        )
        data[start : start + size] = piece
    return bytes(data[: chance.randrange(len(data) + 1)] if chance.random() < 0.1 else data)
