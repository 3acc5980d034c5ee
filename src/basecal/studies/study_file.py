"""The file of a study: its schema, and a reader that reports all mistakes together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Field, create_model
from pydantic import model_validator as checks_whole
from pydantic.fields import FieldInfo

from basecal.cell.format.yaml_text import parse_yaml, read_text
from basecal.cell.schema.errors import check_entry, check_schema
from basecal.cell.targets.registry import AnyTargetEntry, TargetKindName
from basecal.fields.problems import Loc, Problem, dataset_error, shorten
from basecal.fields.values import LARGEST_VALUE, Entry, Status, empty_if_missing, known_name_validator
from basecal.geometry.lenses.registry import lens_models
from basecal.simulation.scenario import Arms, LayoutName
from basecal.studies.cells import SHIFT_LAYOUTS, statuses
from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.study import Point, Study

SCHEMA = "basecal/study/1"
_MOST_TRIALS = 10_000_000  # of a point: a table of some gigabytes
_MOST_CELLS = 10_000
_MOST_VALUES = 1000  # of an axis
_MOST_POINTS = 100_000
_MOST_TRIALS_IN_ALL = 100_000_000  # trials of all points: a table of some ten gigabytes
_MOST_CELLS_IN_ALL = 1_000_000  # of all points; their simulation takes days
_MOST_VIEWED_POINTS = 20_000  # points of a trial: a batch of 256 trials takes some hundred megabytes
_USUAL_POINTS = 36  # of the default boards
_LONGEST_TEXT = 10_000  # characters of a title or description

_Size = Annotated[float, Field(ge=0, le=LARGEST_VALUE)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Factor = Annotated[float, Field(ge=0.5, le=2)]
_Rotation = Annotated[float, Field(ge=0, le=3.15)]
_Solver = Annotated[str, known_name_validator("solver", tuple(SOLVERS))]
_Lens = Annotated[str, known_name_validator("lens", lens_models())]
_Layout = Annotated[str, known_name_validator("layout", (*get_args(LayoutName), *SHIFT_LAYOUTS))]


def _with_carrier(value: Any) -> Any:
    """Complete a target's entry with `on`, which `cell.yaml` requires and a study does not."""
    return {"on": "world", **value} if isinstance(value, dict) else value


_Board = Annotated[AnyTargetEntry, BeforeValidator(_with_carrier)]


class SettingsEntry(Entry):
    """Settings of simulation and solver; each field may be an axis."""

    solver: _Solver = "maximum_likelihood"
    own_starts: bool = False
    layout: _Layout = "dual"
    arms: Arms = "both"
    samples: Annotated[int, Field(ge=1, le=10_000)] = 30
    stations: Annotated[int, Field(ge=1, le=1000)] = 5
    robots: Annotated[int, Field(ge=2, le=100)] = 3
    target: TargetKindName = "charuco"
    board: _Board | None = None
    lens: _Lens = "pinhole"
    distance_m: Annotated[float, Field(gt=0, le=1000)] = 0.7
    spread_rad: _Rotation = 0.6
    position_m: _Size = 0.12
    shift_m: Annotated[float, Field(gt=0, le=10)] = 0.1
    base: Status = "free"
    camera_mount: Status = "free"
    target_mount: Status = "free"
    intrinsics: Status = "fixed"
    pixel_px: _Size = 0.2
    correlated_px: _Size = 0.0
    image_noise: _Share = 0.0
    robot_sigma_t_m: _Size = 0.0
    robot_sigma_r_rad: _Size = 0.0
    state_pixel_noise: bool = True
    state_robot_noise: bool = True
    outlier_share: _Share = 0.0
    outlier_px: _Size = 20.0
    board_scale: _Factor = 1.0
    focal_scale: _Factor = 1.0


def _axis(field: FieldInfo) -> tuple[Any, Any]:
    """Type and default of an axis: a list of values of a field, or None."""
    value = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return GenericAlias(list, (value,)) | None, Field(None, min_length=1, max_length=_MOST_VALUES)


if TYPE_CHECKING:

    class AxesEntry(Entry):
        """The fields of `SettingsEntry`, each a list of values."""
else:
    _FIELDS = {name: _axis(field) for name, field in SettingsEntry.model_fields.items()}
    AxesEntry = create_model("AxesEntry", __base__=Entry, **_FIELDS)


class StudyEntry(Entry):
    """Schema of a study's file."""

    version: Literal["basecal/study/1"] = Field(alias="schema")
    title: Annotated[str, Field(max_length=_LONGEST_TEXT)] = ""
    about: Annotated[str, Field(max_length=_LONGEST_TEXT)] = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    trials: Annotated[int, Field(ge=1, le=_MOST_TRIALS)]
    cells: Annotated[int, Field(ge=1, le=_MOST_CELLS)] = 10
    transform: str | None = None
    hold: Annotated[SettingsEntry, BeforeValidator(empty_if_missing)] = SettingsEntry()
    axes: Annotated[AxesEntry, BeforeValidator(empty_if_missing)] = AxesEntry()

    @checks_whole(mode="after")
    def _cells_share_the_trials(self) -> Self:
        if self.cells > self.trials:
            raise ValueError(f"{self.trials} trials cannot be spread over {self.cells} cells: give fewer cells")
        return self


def read_study(path: str | Path) -> Study:
    """Read a study from a file.

    Raises:
        DatasetError: if the file is invalid; the message has a line for each mistake.
    """
    text = read_text(Path(path), "a study is a YAML file (docs/studies.md)")
    return study_from_text(text, str(path))


def study_from_text(text: str, path: str) -> Study:
    """Read a study from the text of its file; `path` is for messages.

    Raises:
        DatasetError: if the text is invalid; the message has a line for each mistake.
    """
    document = parse_yaml(text, path)
    lines = document.lines
    data = check_schema(document.data, SCHEMA, path, lines)
    entry = check_entry(StudyEntry, data, path, lines)
    study = _study(entry, data, text, path, lines)
    problems = [
        *_repeated_values(study),
        *_unfit_boards(study),
        *(Problem(loc, message) for loc, message in _contradictions(study, data)),
    ]
    if problems:
        raise dataset_error(path, problems, lines)
    return study


def _study(entry: StudyEntry, data: dict[str, Any], text: str, path: str, lines: Mapping[Loc, int]) -> Study:
    stated_axes = {name: getattr(entry.axes, name) for name in data.get("axes") or {}}
    axes = {name: tuple(values) for name, values in stated_axes.items() if values is not None}
    count = 1
    for name, values in axes.items():
        count *= len(values)
        if name in (data.get("hold") or {}):
            raise dataset_error(path, [Problem(("hold", name), "is also an axis: keep only one")], lines)
    if count > _MOST_POINTS:
        raise dataset_error(
            path, [Problem(("axes",), f"make {count} points, at most {_MOST_POINTS} are allowed")], lines
        )
    for field, each, most in (
        ("trials", entry.trials, _MOST_TRIALS_IN_ALL),
        ("cells", entry.cells, _MOST_CELLS_IN_ALL),
    ):
        if count * each > most:
            message = f"{each} at each of {count} points make {count * each}, at most {most} are allowed in all"
            raise dataset_error(path, [Problem((field,), message)], lines)
    held = {name: getattr(entry.hold, name) for name in SettingsEntry.model_fields}
    return Study(
        title=entry.title or Path(path).stem,
        about=entry.about,
        seed=entry.seed,
        trials=entry.trials,
        cells=entry.cells,
        transform=entry.transform,
        held=held,
        axes=axes,
        text=text,
    )


def _repeated_values(study: Study) -> list[Problem]:
    """Problems about repeated values on an axis."""
    return [
        Problem(("axes", name, k), "is on this axis already: remove it")
        for name, values in study.axes.items()
        for k, value in enumerate(values)
        if value in values[:k]
    ]


def _unfit_boards(study: Study) -> list[Problem]:
    """Problems about boards without a kind, and about samples with too many points for the memory."""
    found = []
    is_axis = "samples" in study.axes
    samples = max(study.axes["samples"] if is_axis else [study.held["samples"]])
    for k, board in enumerate(study.axes.get("board", [study.held["board"]])):
        where: Loc = ("axes", "board", k) if "board" in study.axes else ("hold", "board")
        target = None if board is None else board.shape()
        if board is not None and target is None:
            found.append(Problem(where, "needs `kind`, with the sizes of that kind"))
        points = _USUAL_POINTS if target is None else len(target.points)
        if samples * points > _MOST_VIEWED_POINTS:
            count = samples * points
            message = f"{samples} samples of {points} points make {count}, at most {_MOST_VIEWED_POINTS} are allowed"
            found.append(Problem(("axes" if is_axis else "hold", "samples"), message))
    return found


def _contradictions(study: Study, data: dict[str, Any]) -> list[tuple[Loc, str]]:
    """Contradictory settings at any point of the study, each once: the location to change, and a message."""
    found: dict[str, Loc] = {}
    for point in study.points:
        for name, message in point_contradictions(point, study.transform):
            section = "axes" if name in study.axes else "hold"
            is_in_file = name in (data.get(section) or {})
            found.setdefault(message, (section, name) if is_in_file else () if name else ("transform",))
    return [(loc, message) for message, loc in found.items()]


def point_contradictions(point: Point, transform: str | None) -> list[tuple[str, str]]:
    """Contradictory settings at a point: the field to change ("" for `transform`), and a message."""
    settings, problems = point.settings, []
    if refusal := SOLVERS[settings["solver"]].refusal_reason(settings):
        problems.append(("solver", refusal))
    known = {name: status for name, status in statuses(settings).items() if status != "fixed"}
    if not known:
        problems.append(("base", "nothing to solve for: every transform is fixed"))
    elif transform is not None and transform not in known:
        names = f"there are: {', '.join(known)}"
        problems.append(("", f"{shorten(transform)} is not solved for in layout {settings['layout']}; {names}"))
    return problems
