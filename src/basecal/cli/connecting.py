"""Connections of a command: printed, and confirmed once for each cell and address."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from getpass import getpass
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

from basecal.cli.terminal import ask, can_ask, say
from basecal.errors import UsageError, printable

if TYPE_CHECKING:
    from basecal.acquisition.rig import Rig
    from basecal.cell import Cell


@Parameter(name="*")
@dataclass(frozen=True)
class ConnectionOptions:
    """Permissions for connections of a cell.

    Attributes:
        yes: Connect to the addresses in the cell without a question.
        allow_plaintext: Also send passwords to servers that accept them only without encryption.
    """

    yes: bool = False
    allow_plaintext: bool = False


ASK_FIRST = ConnectionOptions()
"""Default permissions of the command line."""


@contextmanager
def allowed_rig(cell: Cell, folder: Path, connecting: ConnectionOptions) -> Iterator[Rig]:
    """The rig of a cell, opened after confirmation, see `open_rig`, and locked against other processes.

    Raises:
        InputError: if another process captures the cell.
        DatasetError: if a driver is not known, or an option is wrong.
        UsageError: if the connections are not allowed, or a password is missing.
    """
    from basecal.acquisition.rig import open_rig
    from basecal.cell.format.locking import locked_folder

    allow_drivers(cell, folder, connecting)
    with locked_folder(folder), open_rig(cell, folder, connecting.allow_plaintext) as rig:
        yield rig


def allow_drivers(cell: Cell, folder: Path, connecting: ConnectionOptions, name: str | None = None) -> None:
    """Ask for permission for the connections of a cell's drivers, or of one driver, and for their passwords.

    Raises:
        DatasetError: if a driver is not known, or an option is wrong.
        UsageError: if a connection is not allowed, or a password is missing.
    """
    from basecal.acquisition.reaching import external_resources, missing_secrets
    from basecal.acquisition.rig import openers

    drivers = [driver for driver in openers(cell, folder) if name in (None, driver[1].name)]
    allow_places(folder, external_resources(drivers), connecting.yes)
    for secret in missing_secrets(drivers):
        if not can_ask():
            raise UsageError(f"the password of {printable(secret.owner)} is missing: put it into {secret.variable}")
        os.environ[secret.variable] = getpass(f"password of {printable(secret.owner)}: ")


def allow_places(folder: Path, places: Sequence[str], yes: bool) -> None:
    """Print new connections, and ask for permission unless the user allowed them before.

    Raises:
        UsageError: if the user refuses, or cannot be asked.
    """
    from basecal.cell.format.consent import allow, is_allowed

    new = [place for place in places if not is_allowed(folder, place)]
    if not new:
        return
    for place in new:
        say(f"{folder} connects to {place}", sys.stderr)
    if yes:
        return
    unasked = f"the cell connects to {'; '.join(map(printable, new))}. Add --yes to allow it"
    ask("Connect?", unasked, "not connected")
    allow(folder, new)
