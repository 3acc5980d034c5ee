"""`basecal import bag`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

from cyclopts import CycloptsError, Parameter

from basecal.cli.detected import Step, counting
from basecal.cli.imported import finish_import
from basecal.cli.lens_import import known_cell, picture_size
from basecal.cli.paired import paired
from basecal.cli.terminal import say

if TYPE_CHECKING:
    from basecal.cell import Cell
    from basecal.exchange.bags.bag import Bag, Message
    from basecal.exchange.bags.sources import Asked, Taken
    from basecal.exchange.bags.survey import Survey
    from basecal.exchange.importing.imported import Imported

_Words = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]


def import_bag(
    cell: Path,
    bag: Path,
    /,
    *,
    list_: Annotated[bool, Parameter(name="--list")] = False,
    robot: _Words = (),
    camera: _Words = (),
    view: _Words = (),
    on: _Words = (),
    tf: bool = False,
    streams: bool = False,
) -> int:
    """Make a recording of a bag of ROS 1 (.bag) or ROS 2 (sqlite3, MCAP).

    Robots come from joint states with /robot_description, which is written into
    the cell, else from tf, or from topics of PoseStamped. Pictures may be raw or
    compressed; camera_info gives the lens of a camera that is new. What is taken
    is found by the usual names, and told; with --list nothing is written.

    Of a recording in which arms stop, each stop at which something was seen is a
    sample: all robots stand for 0.3 s around a picture. With --streams all is
    taken as it moves, and `basecal calibrate` finds by how much clocks differ.

    For example:

        basecal import bag mycell recording --list
        basecal import bag mycell recording --robot left=left_base,left_tool0 \\
            right=right_base,right_tool0 --camera wrist=/wrist/image_raw
        basecal import bag mycell tags.bag --robot arm=/arm/pose \\
            --view wrist,tag=/tag/pose --on wrist=arm --streams

    Args:
        cell: Folder of the cell.
        bag: The bag: a folder of ROS 2, or a .bag, .mcap or .db3.
        list_: Tell what is in the bag, and what would be taken of it.
        robot: NAME=BASE,FLANGE, frames of tf and links of the URDF; or NAME=/TOPIC of PoseStamped.
        camera: NAME=/TOPIC of Image or CompressedImage.
        view: CAMERA,TARGET=/TOPIC of PoseStamped, the target in the camera; or its FRAME,FRAME of tf for a topic.
        on: NAME=ROBOT or NAME=world: what carries a camera or target that is new.
        tf: Take robots from tf where there are joint states as well.
        streams: Take everything, each device at its own times, instead of one sample for each stop.
    """
    from basecal.exchange.bags.bag import opened
    from basecal.exchange.bags.choice import chosen
    from basecal.exchange.bags.survey import surveyed

    asked = _asked(robot, camera, view, on, tf)
    known = known_cell(cell)
    with opened(bag) as there, counting("reading the bag") as step:
        watched = _watched(there, step)
        if list_:
            for topic in sorted(there.topics.values()):
                say(f"  {topic.messages:>8}  {topic.name}  {topic.kind}")
        survey = surveyed(watched)
        taken = chosen(there, survey, asked, known)
        for line in taken.words:
            say(f"{'would take' if list_ else 'taking'} {line}")
        if list_:
            return 0
        beside = next(above for above in cell.absolute().parents if above.exists())
        with TemporaryDirectory(prefix=".bag-", dir=beside) as folder:
            imported = _imported(watched, survey, taken, asked, known, Path(folder), streams)
            return finish_import(cell, imported, advice="check the frames and topics that were taken")


def _imported(
    bag: Bag, survey: Survey, taken: Taken, asked: Asked, known: Cell | None, folder: Path, streams: bool
) -> Imported:
    """What is brought into the cell, pictures and URDFs being in a folder."""
    from basecal.exchange.bags.entry import bag_entry, urdf_name
    from basecal.exchange.bags.rows import rows_of, still_instants, stream_instants, write_pictures
    from basecal.exchange.bags.sources import ByJoints
    from basecal.exchange.bags.tracks import read_tracks
    from basecal.exchange.importing.imported import Imported

    tracks = read_tracks(bag, survey, taken)
    instants = (stream_instants if streams else still_instants)(tracks, bag.path)
    write_pictures(bag, taken, instants, folder)
    rows = tuple(rows_of(tracks, instants, folder))
    first = {name: path for row in reversed(rows) for name, path in row.pictures.items()}
    sizes = {name: size for name, path in first.items() if (size := picture_size(path)) is not None}
    files = {}
    for name, source in taken.robots.items():
        if isinstance(source, ByJoints) and source.urdf is not None:
            files[urdf_name(name)] = folder / urdf_name(name)
            files[urdf_name(name)].write_text(survey.urdfs[source.urdf], encoding="utf-8")
    entry = bag_entry(known, bag.path, survey, taken, asked, sizes)
    what = f"{len(rows)} {'lines of streams' if streams else 'stops'}, metres and radians as ROS has them"
    return Imported(bag.path, what, rows, entry, files=files, is_stream=True)


def _watched(bag: Bag, step: Step) -> Bag:
    """The bag, with its messages counted as they are read: for what is in it, for times, for pictures."""
    total = 3 * sum(topic.messages for topic in bag.topics.values())
    done = 0

    def read(names: Iterable[str]) -> Iterator[Message]:
        """The messages of some topics, each counted."""
        nonlocal done
        for message in bag.read(names):
            done += 1
            step(min(done, total), total)
            yield message

    return replace(bag, read=read)


def _asked(robot: _Words, camera: _Words, view: _Words, on: _Words, tf: bool) -> Asked:
    from basecal.exchange.bags.sources import Asked

    views = {}
    for names, words in paired("--view", view, "CAMERA,TARGET=/TOPIC").items():
        eye, _, target = names.partition(",")
        if not eye or not target:
            raise CycloptsError(msg=f"--view {names}={words}: expected CAMERA,TARGET=/TOPIC")
        views[eye, target] = words
    return Asked(
        paired("--robot", robot, "NAME=BASE,FLANGE"),
        paired("--camera", camera, "NAME=/TOPIC"),
        views,
        paired("--on", on, "NAME=ROBOT"),
        tf,
    )
