"""`basecal driver check`."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from basecal.cli.connecting import ASKING, Connecting, allow_drivers
from basecal.cli.terminal import print_json, say
from basecal.errors import InputError, UsageError, nearest

if TYPE_CHECKING:
    from basecal.acquisition.driver import Place
    from basecal.acquisition.driver_check.promises import Promise

_CUT_S = 20.0  # that a person has to cut a connection and to restore it


def driver_check(
    device: str,
    name: str = "",
    /,
    *,
    option: Annotated[list[str] | None, Parameter(consume_multiple=False)] = None,
    camera: bool = False,
    go: bool = False,
    cut: bool = False,
    connecting: Connecting = ASKING,
    json: bool = False,
) -> int:
    """Measure what the driver of a robot or camera promises.

    Give a cell's folder and the robot or camera, or the name of a driver and
    its options. The arm stands still meanwhile: it measures rate, latency,
    stamps and noise. With --go the last joint turns by 3 deg at 5 deg/s and is
    stopped on the way, by an order and by the silence of a watchdog's
    heartbeat: clear the arm, with a hand on the emergency stop.

    Ends with 0 if every promise that was measured holds, else with 1.

    For example:

        basecal driver check mycell left
        basecal driver check mycell left --go
        basecal driver check ur --option host=192.168.0.10
        basecal driver check opencv --camera --option source=0

    Args:
        device: Folder of a cell, or the name of a driver.
        name: The robot or camera of the cell.
        option: An option of the driver, as KEY=VALUE; several times for several.
        camera: The driver named is that of a camera.
        go: Move the arm a little and measure how it stops.
        cut: Ask for the connection to be cut and restored, and measure the outage.
        connecting: What the cell may reach.
        json: Print the measurements as JSON.
    """
    if (Path(device) / "cell.yaml").is_file():
        if option or camera:
            raise UsageError("--option and --camera go with the name of a driver; the cell states its own options")
        place = _place_in_cell(Path(device), name, connecting)
    else:
        place = _place_of_kind(device, option or [], camera)
    promises = _measure(place, go, cut, quiet=json)
    if json:
        print_json({"name": place.name, "promises": [vars(each) for each in promises]})
    return 1 if any(each.holds is False for each in promises) else 0


def _place_in_cell(folder: Path, name: str, connecting: Connecting) -> Place:
    from basecal.acquisition.driver import Place
    from basecal.cell.files import read_cell

    cell = read_cell(folder)
    things = {each: robot.driver for each, robot in cell.robots.items() if robot.driver}
    things |= {each: camera.driver for each, camera in cell.cameras.items() if camera.driver}
    if name not in things:
        known = ", ".join(things) or "none"
        raise UsageError(f"no robot or camera {name!r} with a driver{nearest(name, things)}; there are: {known}")
    allow_drivers(cell, folder, connecting, name)
    return Place(name, cell, folder, things[name].options, connecting.allow_plaintext)


def _place_of_kind(kind: str, options: list[str], is_camera: bool) -> Place:
    from basecal.acquisition.driver import Place
    from basecal.acquisition.drivers.registry import driver_names
    from basecal.cell import Cell, CellCamera, Driver, Robot

    known = driver_names()
    if kind not in known:
        hint = nearest(kind, known)
        raise InputError(f"no driver and no cell {kind!r}{hint}; drivers are: {', '.join(known)}")
    driver = Driver(kind, dict(_option(each) for each in options))
    if is_camera:
        cameras = {"camera": CellCamera("camera", "world", driver=driver)}
        cell = Cell("robot", {"robot": Robot("robot")}, cameras=cameras)
        return Place("camera", cell, Path("."), driver.options)
    return Place("robot", Cell("robot", {"robot": Robot("robot", driver=driver)}), Path("."), driver.options)


def _option(text: str) -> tuple[str, Any]:
    from json import loads

    key, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"--option {text!r}: expected KEY=VALUE")
    try:
        return key, loads(value)
    except ValueError:
        return key, value


def _measure(place: Place, go: bool, cut: bool, quiet: bool) -> list[Promise]:
    """Promises, each printed when it is measured."""
    from basecal.acquisition.driver_check.promises import camera_promises, reconnection_promise, robot_promises
    from basecal.acquisition.drivers.registry import driver_kind

    is_robot = place.name in place.cell.robots
    driver = (place.cell.robots if is_robot else place.cell.cameras)[place.name].driver
    kind = None if driver is None else driver_kind(driver.kind)
    if kind is None or (kind.open_robot if is_robot else kind.open_camera) is None:
        raise InputError(f"no driver of that name is for {'robots' if is_robot else 'cameras'}")
    if not is_robot:
        with closing(kind.camera(place)) as camera:
            return [_print_promise(each, quiet) for each in camera_promises(camera)]
    with closing(kind.robot(place)) as robot:
        found = [_print_promise(each, quiet) for each in robot_promises(place.name, robot, kind.stop_guarantee, go)]
        if cut:
            say(f"Cut the connection of {place.name} now, for three seconds, and restore it.")
            found.append(_print_promise(reconnection_promise(place.name, robot, _CUT_S), quiet))
        return found


def _print_promise(promise: Promise, quiet: bool) -> Promise:
    if not quiet:
        verdict = {True: "holds", False: "FAILS", None: "-"}[promise.holds]
        say(f"{verdict:<6} {promise.promise:<44} {promise.measured}")
    return promise
