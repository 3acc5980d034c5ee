"""What was tried so far, by ranges of seeds, so that runs of many days add up and none counts twice.

A line of `benchmarks/results/torment.json` for each kind of trial and commit; `python -m torment.record` writes their
sum into the tables of docs/reliability.md and SECURITY.md.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

_ROOT = Path(__file__).parents[2]
FILE = _ROOT / "benchmarks" / "results" / "torment.json"
PAGE = _ROOT / "docs" / "reliability.md"
PROMISES = _ROOT / "SECURITY.md"
REMARKABLE = ("failed", "good and moved")  # what is kept with its seed
HEAD = ("what", "tried", "answered", "refused", "else", "failed", "commits")


@dataclass(frozen=True)
class Row:
    """Trials of one kind at one commit.

    Attributes:
        what: Their kind.
        commit: Of the sources.
        first, end: Their seeds, from the first to before the end.
        came: How often what came of them.
        seeds: Of what is remarkable among that, and why, where it is known.
    """

    what: str
    commit: str | None
    first: int
    end: int
    came: Mapping[str, int]
    seeds: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def read(path: Path = FILE) -> list[Row]:
    """All that was recorded; nothing where there is no file.

    Raises:
        ValueError: if a row does not count its seeds, or two rows of a kind share some.
    """
    rows = [Row(**row) for row in json.loads(path.read_text())["rows"]] if path.exists() else []
    ends: dict[str, int] = {}
    for row in sorted(rows, key=lambda row: (row.what, row.first)):
        if row.end - row.first != sum(row.came.values()):
            raise ValueError(f"{row.what} from seed {row.first}: {sum(row.came.values())} trials up to {row.end}")
        if row.first < ends.get(row.what, 0):
            raise ValueError(f"{row.what}: seed {row.first} is counted twice")
        ends[row.what] = row.end
    return rows


def next_seed(rows: Iterable[Row], what: str, lowest: int = 0) -> int:
    """The first seed, from `lowest` on, above all that were tried."""
    return max([lowest, *(row.end for row in rows if row.what == what)])


def added(rows: list[Row], new: Row) -> list[Row]:
    """The rows and one more, which is joined to the one of its kind and commit that it continues."""
    for k, row in enumerate(rows):
        if (row.what, row.commit, row.end) == (new.what, new.commit, new.first):
            came = dict(Counter(row.came) + Counter(new.came))
            seeds = {each: {**row.seeds.get(each, {}), **new.seeds.get(each, {})} for each in REMARKABLE}
            kept = {each: found for each, found in seeds.items() if found}
            return [*rows[:k], Row(row.what, row.commit, row.first, new.end, came, kept), *rows[k + 1 :]]
    return [*rows, new]


def write(rows: Iterable[Row], path: Path = FILE) -> None:
    """Write the rows, one a line, so that changes are read easily."""
    lines = ",\n".join(json.dumps(asdict(row)) for row in rows)
    part = path.with_suffix(".part")
    part.write_text(f'{{"rows": [\n{lines}\n]}}\n')
    part.replace(path)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def commit() -> str | None:
    """The commit that is checked out, short; None outside a checkout."""
    asked = ["git", "-C", str(_ROOT), "rev-parse", "--short", "HEAD"]
    done = subprocess.run(asked, capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else None


def summed(rows: Iterable[Row]) -> str:
    """A markdown table of what came of each kind, over all commits."""
    came: dict[str, Counter[str]] = {}
    commits: dict[str, dict[str, None]] = {}
    for row in rows:
        came.setdefault(row.what, Counter()).update(row.came)
        commits.setdefault(row.what, {})[str(row.commit)] = None
    shown = [(what, f"{counts.total():,}", *columns(counts), ", ".join(commits[what])) for what, counts in came.items()]
    return table(HEAD, shown)


def without_folders(text: str) -> str:
    """Text with files by their names alone: folders are those of one machine."""
    return re.sub(r"(?<![\w.])/(?:[^\s/\"';]+/)+", "", text)


def columns(counts: Counter[str]) -> tuple[str, str, str, str]:
    """How many were answered, refused, came to something else, and failed."""
    others = ", ".join(f"{what} {n:,}" for what, n in sorted(counts.items()) if what not in _NAMED)
    return f"{counts['answered']:,}", f"{counts['refused']:,}", others, f"{counts['failed']:,}"


_NAMED = ("answered", "refused", "failed")


def page(text: str, rows: Iterable[Row]) -> str:
    """The text of docs/reliability.md with its table of what was tried written anew."""
    lines = text.splitlines(keepends=True)
    start = next(k for k, line in enumerate(lines) if line.startswith("| " + " | ".join(HEAD[:3])))
    end = next((k for k in range(start, len(lines)) if not lines[k].startswith("|")), len(lines))
    return "".join([*lines[:start], summed(rows) + "\n", *lines[end:]])


def promises(text: str, rows: Iterable[Row], modules: Mapping[str, str]) -> str:
    """The text of SECURITY.md with its counts of seeds written anew, of promises and of sessions.

    Args:
        text: The text.
        rows: What was tried.
        modules: The module of each kind of trial, by which a promise names its trials.
    """
    tried: Counter[str] = Counter()
    came: dict[str, Counter[str]] = {}
    for row in rows:
        tried[row.what] += row.end - row.first
        came.setdefault(row.what, Counter()).update(row.came)
    lines, head = [], ""
    for line in text.splitlines():
        head = line if line.startswith(("| promise |", "| driver |")) else head if line.startswith("|") else ""
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if head.startswith("| promise |") and line != head and not line.startswith("|---"):
            line = "| " + " | ".join([*cells[:2], _seeds(cells[1], tried, modules)]) + " |"
        elif head.startswith("| driver |") and cells[0] in _SESSIONS:
            found = came.get(_SESSIONS[cells[0]], Counter())
            line = "| " + " | ".join([cells[0], f"{found.total()}", *(f"{found[each]}" for each in _ENDS)]) + " |"
        lines.append(line)
    return "\n".join(lines) + "\n"


_SESSIONS = {
    "UR": "driver ur",
    "OPC UA": "driver opcua",
    "ROS 2": "driver ros2",
    "OpenCV": "driver opencv",
    "simulated cell": "driver simulated, peer",
}
_ENDS = ("answered", "refused", "interrupted", "ended before its interrupt", "failed")


def _seeds(trial: str, tried: Counter[str], modules: Mapping[str, str]) -> str:
    """How many seeds the trials that a promise names were given, and of how many kinds; `tests` if it names none."""
    named = set(re.findall(r"(\w+)\.py", trial))
    alone = re.findall(r"`([\w ]+)` of `", trial)
    kinds = alone or [kind for kind, module in modules.items() if module in named or "outcome" in named]
    if not kinds:
        return "tests"
    counts = [tried[kind] for kind in kinds if tried[kind]]
    text = f"{sum(counts):,}" + (f" of {len(counts)} kinds, at least {min(counts):,} each" if len(counts) > 1 else "")
    missing = [kind for kind in kinds if not tried[kind]]
    return f"{text}; not yet tried: {', '.join(missing)}" if missing and counts else text


def trial_modules() -> dict[str, str]:
    """The module of each kind of trial, without its package."""
    from torment import guided
    from torment.hostile_cell import EACH
    from torment.run import TRIALS

    known = {name: getattr(trial, "func", trial).__module__.rpartition(".")[2] for name, trial in TRIALS.items()}
    known |= {guided.recorded_name(kind): "guided" for kind in ("bag", "Parquet")}
    return {**known, EACH: known["hostile cell"]}


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(), read()))
    PROMISES.write_text(promises(PROMISES.read_text(), read(), trial_modules()))
