"""`basecal driver check`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from basecal.cli.connecting import ASK_FIRST, ConnectionOptions, allow_drivers
from basecal.cli.terminal import print_json, say
from basecal.errors import UsageError

if TYPE_CHECKING:
    from basecal.acquisition.driver_check.promises import Promise


def driver_check(
    device: str,
    name: str = "",
    /,
    *,
    option: Annotated[list[str] | None, Parameter(consume_multiple=False)] = None,
    camera: bool = False,
    go: bool = False,
    cut: bool = False,
    connecting: ConnectionOptions = ASK_FIRST,
    json: bool = False,
) -> int:
    """Measure whether the driver of a robot or camera does what it promises.

    Give a cell's folder and the robot or camera, or the name of a driver and
    its options. With the arm at rest, rate, latency, stamps and noise are
    measured. With --go the last joint rotates by 3 deg at 5 deg/s. It is stopped
    during the motion, by a command and by loss of the watchdog's heartbeat. Keep
    clear of the arm, with a hand on the emergency stop.

    Exit code: 0 if every measured promise holds, else 1.

    For example:

        basecal driver check mycell left
        basecal driver check mycell left --go
        basecal driver check ur --option host=192.168.0.10
        basecal driver check opencv --camera --option source=0

    Args:
        device: Folder of a cell, or the name of a driver.
        name: The robot or camera of the cell.
        option: An option of the driver, as KEY=VALUE; may be given several times.
        camera: The named driver is that of a camera.
        go: Move the arm slightly and measure how it stops.
        cut: Ask the user to cut and restore the connection, and measure the outage.
        connecting: Connections that the cell may make.
        json: Print the measurements as JSON.
    """
    from basecal.acquisition.driver_check.check_process import DriverCheck, find_opener, measure_promises
    from basecal.cell.format.locking import locked_folder

    options = dict(_parse_option(each) for each in option or [])
    check = DriverCheck(device, name, options, camera, go, cut, connecting.allow_plaintext)
    _, device_place = find_opener(check)
    if check.is_in_cell:
        if option or camera:
            raise UsageError("--option and --camera go with the name of a driver; the cell states its own options")
        allow_drivers(device_place.cell, Path(device), connecting, name)
    with locked_folder(Path(device)) if check.is_in_cell else nullcontext():
        promises = [_print_promise(each, quiet=json) for each in measure_promises(check)]
    measured = [each for each in promises if not isinstance(each, str)]
    if json:
        print_json({"name": device_place.name, "promises": [vars(each) for each in measured]})
    return 1 if any(each.holds is False for each in measured) else 0


def _parse_option(text: str) -> tuple[str, Any]:
    from json import loads

    key, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"--option {text!r}: expected KEY=VALUE")
    try:
        return key, loads(value)
    except ValueError:
        return key, value


def _print_promise(promise: Promise | str, quiet: bool) -> Promise | str:
    """Print a promise, or an instruction to the user, and return it."""
    if isinstance(promise, str):
        say(promise)
    elif not quiet:
        verdict = {True: "holds", False: "FAILS", None: "-"}[promise.holds]
        say(f"{verdict:<6} {promise.promise:<44} {promise.measured}")
    return promise
