"""Faults of a running cell, and their command-line syntax."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from basecal.effects.faces.effect import DEGREE, MILLI, ONE, SECOND, SimulatedFault
from basecal.effects.registry import EFFECTS
from basecal.errors import InputError, spelling_hint

_PUSHED_EFFECT = "turned by 1 mrad a mm"
_SIMULATOR_FAULTS = (
    SimulatedFault("backlash", "deg", DEGREE, 0.1, "backlash of each joint: it stops on the side from which it comes"),
    SimulatedFault("encoder-noise", "deg", DEGREE, 0.02, "noise of each state of each joint, one sigma"),
    SimulatedFault(
        "ringing", "mrad", MILLI, 2.0, "amplitude of joint oscillations in the first half second after arrival"
    ),
    SimulatedFault("late-trigger", "s", SECOND, 0.1, "delay of the exposure after the stamp of the image"),
    SimulatedFault("dropped-frames", "share", ONE, 0.2, "share of images that are lost"),
    SimulatedFault("base-bumped", "mm", MILLI, 5.0, f"the second base is pushed, and {_PUSHED_EFFECT}", True),
    SimulatedFault(
        "board-remounted", "mm", MILLI, 5.0, f"the target is taken off and put back, {_PUSHED_EFFECT}", True
    ),
    SimulatedFault("reflection", "share", ONE, 0.4, "a glossy tray reflects the LED with this share of its brightness"),
)
_EFFECT_FAULTS = (effect.fault for effect in EFFECTS.values() if effect.fault is not None)
FAULTS = {fault.name: fault for fault in (*_EFFECT_FAULTS, *_SIMULATOR_FAULTS)}
"""Available faults by name: those of the effects, and those of the simulator."""
_SUDDEN_DELAY_MOVES = 12  # moves of the arm before a sudden fault: about half of a usual recording


@dataclass(frozen=True)
class Fault:
    """An active fault: its name, its size in SI units, and the number of moves before it occurs; 0 from the start."""

    name: str
    size: float
    after_moves: int = 0


@dataclass(frozen=True)
class Faults:
    """Faults of a cell."""

    faults: tuple[Fault, ...] = ()

    def size(self, name: str) -> float:
        """Size of a fault in SI units, 0 if it is off."""
        return sum(fault.size for fault in self.faults if fault.name == name)

    def delay_moves(self, name: str) -> int:
        """Number of moves before a fault occurs."""
        return next((fault.after_moves for fault in self.faults if fault.name == name), 0)


def read_faults(texts: Sequence[str]) -> Faults:
    """Parse faults of the form `NAME`, `NAME=SIZE` or `NAME=SIZE@MOVES`, with the size in the unit of the fault.

    Raises:
        InputError: if a name is unknown, a size is not a positive number, or a fault is given twice.
    """
    faults = tuple(_parse_fault(each) for each in texts)
    names = [fault.name for fault in faults]
    if len(set(names)) < len(names):
        twice = next(name for place, name in enumerate(names) if name in names[:place])
        raise InputError(f"the fault {twice} is given twice")
    return Faults(faults)


def _parse_fault(text: str) -> Fault:
    name, _, rest = text.partition("=")
    if name not in FAULTS:
        raise InputError(f"no fault {name!r}{spelling_hint(name, FAULTS)}; there are: {', '.join(FAULTS)}")
    kind = FAULTS[name]
    size_text, _, moves_text = rest.partition("@")
    try:
        size = float(size_text) if size_text else kind.default_size
        moves = int(moves_text) if moves_text else _SUDDEN_DELAY_MOVES if kind.is_sudden else 0
    except ValueError:
        raise InputError(f"{text!r}: expected {name}, {name}=SIZE [{kind.unit}] or {name}=SIZE@MOVES") from None
    if not (0 < size < math.inf) or moves < 0:
        raise InputError(f"{text!r}: expected a size above 0 [{kind.unit}], and moves of 0 or more")
    if moves and not kind.is_sudden:
        raise InputError(f"{text!r}: {name} acts from the start; omit @{moves}")
    return Fault(name, size * kind.scale, moves)
