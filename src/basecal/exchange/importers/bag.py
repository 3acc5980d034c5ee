"""Import of ROS 1 and ROS 2 bags."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from basecal.cell.targets.registry import TargetKindName
from basecal.errors import InputError, UsageError
from basecal.exchange.bags.bag import Bag, Message, open_bag, repair_command
from basecal.exchange.bags.choice import choose_sources
from basecal.exchange.bags.entry import bag_entry, urdf_name
from basecal.exchange.bags.rows import make_rows, still_instants, stream_instants, write_images
from basecal.exchange.bags.sources import BagRequest, BagSources, ByJoints
from basecal.exchange.bags.survey import Survey, survey_bag
from basecal.exchange.bags.tracks import read_tracks
from basecal.exchange.images import image_size
from basecal.exchange.importing.cell_files import scratch_folder
from basecal.exchange.importing.described_target import UNSTATED_SHAPE, Shape, target_entry
from basecal.exchange.importing.imported import Imported, KnownCell, ViewNames, known_cell
from basecal.fields.typed_length import parse_name_options

Progress = Callable[[int, int], None]


def read_bag(
    cell: str | Path,
    bag: str | Path,
    /,
    *,
    list: bool = False,
    robot: tuple[str, ...] = (),
    camera: tuple[str, ...] = (),
    view: tuple[str, ...] = (),
    on: tuple[str, ...] = (),
    tf: bool = False,
    streams: bool = False,
    target: TargetKindName | None = None,
    target_on: str | None = None,
    target_name: str = "board",
    shape: Shape = UNSTATED_SHAPE,
    progress: Progress | None = None,
) -> Imported:
    """Import a ROS 1 (.bag) or ROS 2 (sqlite3, MCAP) bag as a recording.

    Robots are read from joint states with /robot_description, which is copied
    into the cell, else from tf, or from topics of PoseStamped. Images may be raw
    or compressed; camera_info gives the lens of a new camera. Topics are found by
    their usual names, and printed; with --list nothing is written.

    If the arms stop, each stop with an image or view becomes a sample: all robots
    are at rest for 0.3 s around the image. With --streams all data are read in
    motion, and `basecal calibrate` estimates the clock offsets.

    For example:

        basecal import bag mycell recording --list
        basecal import bag mycell recording --robot left=left_base,left_tool0 \\
            right=right_base,right_tool0 --camera wrist=/wrist/image_raw
        basecal import bag mycell recording --target charuco --squares 5x7 \\
            --square 40mm --target-on right
        basecal import bag mycell tags.bag --robot arm=/arm/pose \\
            --view wrist,tag=/tag/pose --on wrist=arm --streams

    Args:
        cell: Folder of the cell.
        bag: The bag: a folder of ROS 2, or a .bag, .mcap or .db3.
        list: List the content of the bag and the data to be imported.
        robot: NAME=BASE,FLANGE, frames of tf and links of the URDF; or NAME=/TOPIC of PoseStamped.
        camera: NAME=/TOPIC of Image or CompressedImage.
        view: CAMERA,TARGET=/TOPIC of PoseStamped, the target in the camera; or FRAME,FRAME of tf instead of a topic.
        on: NAME=ROBOT or NAME=world: carrier of a new camera or target.
        tf: Read robots from tf even if there are joint states.
        streams: Read all data, each device at its own times, instead of one sample per stop.
        target: Kind of the target in the images, if the cell does not describe it; its sizes are below.
        target_on: Carrier of the target: a robot (its flange), or `world`.
        target_name: Name of the target.
        shape: Counts and sizes of the target.
        progress: Called after each message with the number of messages read and their total.

    Raises:
        UsageError: if an option has the wrong form.
        MissingExtra: if the library for bags is not installed.
        InputError: if the bag cannot be read, or is inconsistent with the cell.
    """
    request = _request(robot, camera, view, on, tf)
    known = known_cell(cell)
    with open_bag(Path(bag)) as opened:
        counted = opened if progress is None else _count_messages(opened, progress)
        survey = survey_bag(counted)
        if list:
            return _preview(opened, survey, request, known)
        try:
            sources = choose_sources(opened, survey, request, known)
        except InputError as error:
            raise InputError("; ".join((f"{opened.path}: {error}", *_damage(opened)))) from None
        with scratch_folder(cell) as scratch:
            imported = _import_bag(counted, survey, sources, request, known, Path(scratch.name), streams)
            imported = _with_target(imported, cell, target, target_name, target_on, shape)
        notes = tuple(f"taking {line}" for line in sources.words)
        return replace(imported, scratch=scratch, notes=notes, warnings=_damage(opened))


def _preview(bag: Bag, survey: Survey, request: BagRequest, present_cell: KnownCell) -> Imported:
    """Preview of a bag: its content, and the data that would be imported or the reason why none would."""
    try:
        would_take = choose_sources(bag, survey, request, present_cell).words
    except InputError as error:
        would_take = [f"nothing: {error}"]
    topics = (f"  {each.messages:>8}  {each.name}  {each.kind}" for each in sorted(bag.topics.values()))
    return Imported(
        bag.path,
        "what is in it",
        notes=(*topics, *(f"would take {line}" for line in would_take)),
        warnings=_damage(bag),
        is_preview=True,
    )


def _with_target(
    source: Imported,
    folder: str | Path,
    kind: TargetKindName | None,
    name: str,
    carrier: str | None,
    shape: Shape,
) -> Imported:
    """A copy with an entry for the target in the images, if one is described."""
    carriers = {name: camera.get("on") for name, camera in source.cell.get("cameras", {}).items()}
    camera = next(iter(carriers), "")
    entries = target_entry(folder, kind, shape, ViewNames(camera, name, carriers.get(camera), carrier))
    sections = {key: {**source.cell.get(key, {}), **entry} for key, entry in entries.items() if key == "targets"}
    return replace(source, cell={**source.cell, **sections})


def _damage(bag: Bag) -> tuple[str, ...]:
    fix = repair_command(Path(bag.path))
    return tuple(f"{bag.path} is read up to where it is damaged ({why}); {fix} may save the rest" for why in bag.damage)


def _import_bag(
    bag: Bag,
    survey: Survey,
    selection: BagSources,
    request: BagRequest,
    present_cell: KnownCell,
    folder: Path,
    streams: bool,
) -> Imported:
    """Import rows and entries for the cell; images and URDFs are written into a folder."""
    tracks = read_tracks(bag, survey, selection)
    instants = (stream_instants if streams else still_instants)(tracks, bag.path)
    rows = tuple(make_rows(tracks, instants, write_images(bag, selection, instants, folder)))
    first = {name: path for row in reversed(rows) for name, path in row.images.items()}
    sizes = {name: size for name, path in first.items() if (size := image_size(path)) is not None}
    files = {}
    for name, source in selection.robots.items():
        if isinstance(source, ByJoints) and source.urdf is not None:
            files[urdf_name(name)] = folder / urdf_name(name)
            files[urdf_name(name)].write_text(survey.urdfs[source.urdf], encoding="utf-8")
    entry = bag_entry(present_cell, bag.path, survey, selection, request, sizes)
    what = f"{len(rows)} {'lines of streams' if streams else 'stops'}, metres and radians as ROS has them"
    advice = "check the frames and topics that were taken"
    return Imported(bag.path, what, rows, entry, files=files, is_stream=True, advice=advice)


def _count_messages(bag: Bag, progress: Progress) -> Bag:
    """Wrap a bag to report progress; messages are read three times: survey, tracks and images."""
    total = 3 * sum(topic.messages for topic in bag.topics.values())
    done = 0

    def read(names: Iterable[str]) -> Iterator[Message]:
        """Read the messages of some topics and count them."""
        nonlocal done
        for message in bag.read(names):
            done += 1
            progress(min(done, total), total)
            yield message

    return replace(bag, read=read)


def _request(
    robot: tuple[str, ...], camera: tuple[str, ...], view: tuple[str, ...], carriers: tuple[str, ...], tf: bool
) -> BagRequest:
    views = {}
    for names, words in parse_name_options("--view", view, "CAMERA,TARGET=/TOPIC").items():
        eye, _, target = names.partition(",")
        if not eye or not target:
            raise UsageError(f"--view {names}={words}: expected CAMERA,TARGET=/TOPIC")
        views[eye, target] = words
    return BagRequest(
        parse_name_options("--robot", robot, "NAME=BASE,FLANGE"),
        parse_name_options("--camera", camera, "NAME=/TOPIC"),
        views,
        parse_name_options("--on", carriers, "NAME=ROBOT"),
        tf,
    )
