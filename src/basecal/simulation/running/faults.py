"""What can be wrong with a running cell, a line each: its name, its size, and the truth that is written of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from basecal.errors import InputError, nearest


@dataclass(frozen=True)
class FaultKind:
    """A fault that can be switched on.

    Attributes:
        unit: Of its size as it is written.
        scale: The unit, in SI.
        usual: Its size where none is given.
        about: What it does, in words.
        is_sudden: Whether it happens at a moment, after a number of moves of the arm it befalls.
    """

    unit: str
    scale: float
    usual: float
    about: str
    is_sudden: bool = False


_DEGREE, _MM, _SECOND, _ONE = math.radians(1), 1e-3, 1.0, 1.0
FAULTS = {
    "joint-offsets": FaultKind("deg", _DEGREE, 0.2, "the zero of each joint is off, one sigma"),
    "link-errors": FaultKind("mm", _MM, 0.5, "each link is off, one sigma per axis, and turned by 1 mrad a mm"),
    "backlash": FaultKind("deg", _DEGREE, 0.1, "play of each joint: it stops on the side it comes from"),
    "encoder-noise": FaultKind("deg", _DEGREE, 0.02, "noise of each state of each joint, one sigma"),
    "sag": FaultKind("deg", _DEGREE, 0.1, "a joint yields by so much under 50 Nm of the links' weight"),
    "ringing": FaultKind("mrad", 1e-3, 2.0, "joints swing by so much for half a second after they arrive"),
    "clock-offset": FaultKind("s", _SECOND, 0.2, "the camera's clock is ahead of the arms'"),
    "late-trigger": FaultKind("s", _SECOND, 0.1, "pictures are taken so much later than their stamps say"),
    "dropped-frames": FaultKind("share", _ONE, 0.2, "pictures that never come; the next one does"),
    "base-bumped": FaultKind("mm", _MM, 5.0, "the second base is pushed, and turned by 1 mrad a mm", is_sudden=True),
    "board-remounted": FaultKind("mm", _MM, 5.0, "the target is taken off and put back, turned by 1 mrad a mm", True),
    "reflection": FaultKind(
        "share", _ONE, 0.4, "a glossy tray shows the light again, with this share of its brightness"
    ),
}
_SUDDENLY_AFTER = 12  # moves of the arm: about half of a usual recording


@dataclass(frozen=True)
class Fault:
    """A fault that is switched on: its name, its size in SI, and after how many moves it comes; 0 is from the start."""

    name: str
    size: float
    after_moves: int = 0


@dataclass(frozen=True)
class Faults:
    """All that is wrong with a cell."""

    faults: tuple[Fault, ...] = ()

    def size(self, name: str) -> float:
        """Size of a fault in SI, 0 where it is off."""
        return sum(fault.size for fault in self.faults if fault.name == name)

    def after(self, name: str) -> int:
        """After how many moves a fault comes."""
        return next((fault.after_moves for fault in self.faults if fault.name == name), 0)


def read_faults(written: Sequence[str]) -> Faults:
    """Faults as they are switched on: `NAME`, `NAME=SIZE` or `NAME=SIZE@MOVES`, the size in the unit of its kind.

    Raises:
        InputError: if a name is not known, a size no positive number, or one is given twice.
    """
    faults = tuple(_fault(each) for each in written)
    names = [fault.name for fault in faults]
    if len(set(names)) < len(names):
        twice = next(name for place, name in enumerate(names) if name in names[:place])
        raise InputError(f"the fault {twice} is given twice")
    return Faults(faults)


def _fault(written: str) -> Fault:
    name, _, rest = written.partition("=")
    if name not in FAULTS:
        raise InputError(f"no fault {name!r}{nearest(name, FAULTS)}; there are: {', '.join(FAULTS)}")
    kind = FAULTS[name]
    size_text, _, moves_text = rest.partition("@")
    try:
        size = float(size_text) if size_text else kind.usual
        moves = int(moves_text) if moves_text else _SUDDENLY_AFTER if kind.is_sudden else 0
    except ValueError:
        raise InputError(f"{written!r}: expected {name}, {name}=SIZE [{kind.unit}] or {name}=SIZE@MOVES") from None
    if not (0 < size < math.inf) or moves < 0:
        raise InputError(f"{written!r}: expected a size above 0 [{kind.unit}], and moves of 0 or more")
    if moves and not kind.is_sudden:
        raise InputError(f"{written!r}: {name} is there from the start; leave @{moves} away")
    return Fault(name, size * kind.scale, moves)
