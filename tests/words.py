"""Names and sentences of the project, and what is wrong with them.

    python -m tests.words names [--faults]        modules, functions, parameters and constants
    python -m tests.words sentences               sentences that are too long, hold a replaced word, or begin badly
    python -m tests.words draw [--draw 30 --seed 1]    docstrings and messages drawn at random

A function is named by a verb with its object, or by the noun that it returns. A parameter is named by a noun, a
constant by what it counts. A docstring begins with a verb, or with the noun that it is about. A sentence of a message
has at most 20 words, one of a docstring or a document at most 25. A value that is filled in counts as one word.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.source_trees import nodes_of, parsed

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "basecal"
DOCUMENTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "ARCHITECTURE.md")
MESSAGE_WORDS, DOCUMENT_WORDS = 20, 25


def word_set(text: str) -> frozenset[str]:
    """The words of a text."""
    return frozenset(text.split())


IRREGULAR = word_set(
    "told said shaken hung seen found kept made drawn taken left held given known chosen heard grown sent built "
    "put lit fed stood begun gone done learnt meant written shown worn lost brought taught understood bent "
    "risen driven frozen"
)
NO_PARTICIPLES = word_set("speed seed need embed feed bed led shed red exceed proceed testbed")
NO_NAMES = word_set(
    "about above across after against ahead alike alone along among anew apart around at away before behind below "
    "beside besides between beyond both by each either else elsewhere enough ever few fewest for further hardly "
    "how in into just like little many more most near nearer never none now of off often on once only onto other "
    "others out outside over per since so some such than that these this those through together too toward "
    "towards under until up upon upwards what when where whether which while who whole whom whose why within "
    "without yet"
)
VAGUE = word_set(
    "rounds steps share margin most least far little enough many settled kept known same tiny nothing tries "
    "passes iterations window depth head order named shown listed best better"
)
PUBLIC = word_set("between import_into wanted imported")  # of documented nouns, and modules that plug-ins import
REPLACED = word_set("told mended shaken alike door worth anywhere surprise")
REPLACED_IN_TESTS = REPLACED | word_set(
    "tell tells say says said mend mends stand stands stood whoever nobody everybody somebody anybody befalls errs"
)
NO_FIRST_WORDS = word_set("What Of Those That Likewise So Who Whose It Nothing By From")  # of a docstring
BUILDERS = word_set("with without to from as is has are was needs can read wait leave")
PHRASES = {
    r"\btold\b|\btells?\b": "report, print, state",
    r"\bmend(?:s|ed)?\b": "fix",
    r"\b(?:of|by) (?:itself|themselves)\b": "alone, separately",
    r"\bwhere it stands\b|\bstands for\b": "is, its pose",
    r"\bstates none\b|\bnobody states\b": "unstated",
    r"\bnumbers end\b|\bbeyond numbers\b": "not finite, the solve fails",
    r"\bso read\b": "under this hypothesis",
    r"\bsays? nothing to\b": "has no effect on",
    r"\bthat cannot be(?=[,.;:)]|$)": "implausible",
    r"\btaken for exact\b": "assumed exact",
    r"\basked for\b": "requested",
    r"\bloop-closure\b": "pose consistency",
    r"\bbetter half\b": "best 50 %",
    r"\bmade up for\b": "compensated",
    r"\bin common\b": "shared",
    r"\balike\b": "equal, the same",
    r"\bbefalls?\b": "occurs",
    r"\bhas the face of\b": "implements",
    r"\berrs\b": "has an error, is off",
    r"\bas calibrated\b": "unchanged",
    r"\bsurprises?\b": "negative log evidence",
    r"\bshaken\b": "with timing jitter",
    r"\bat the door\b": "input screening",
}
"""What is not written, with what is written instead."""
PRIVATE = re.compile("|".join(PHRASES), re.IGNORECASE)


class Name(NamedTuple):
    """A name that somebody chose: its kind, file and line, and whether other programs or Python's own rules fix it."""

    kind: str
    path: str
    line: int
    name: str
    is_fixed: bool = False


class Text(NamedTuple):
    """A docstring, a message or a paragraph of a document."""

    kind: str
    path: str
    line: int
    text: str


def sources() -> list[Path]:
    """All files of the package."""
    return sorted(SOURCE.rglob("*.py"))


def names() -> Iterator[Name]:
    """All names of the package."""
    for path in sources():
        place = str(path.relative_to(ROOT))
        if path.stem not in ("__init__", "__main__"):
            yield Name("module", place, 1, path.stem, path.parent.name == "drivers" or path.stem in PUBLIC)
        for node in nodes_of(parsed(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                is_finding = place.startswith("src/basecal/accuracy/findings/") and node.name == path.stem
                yield Name("function", place, node.lineno, node.name, is_finding or node.name in PUBLIC)
                every = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                listed = {arg.arg for arg in every}
                yield from (
                    Name("parameter", place, arg.lineno, arg.arg, is_fixed(arg.arg, node.name, listed, place))
                    for arg in every
                )
        yield from constants(path, place)


def names_of_tests() -> Iterator[Name]:
    """Names of all test functions."""
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in nodes_of(parsed(path)):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                yield Name("test", str(path.relative_to(ROOT)), node.lineno, node.name)


def is_fixed(name: str, function: str, listed: set[str], place: str) -> bool:
    """Whether a parameter is an option that users type, one of a documented method, or `left` beside `right`."""
    room, stem = Path(place).parent.name, Path(place).stem
    is_option = (room == "cli" and function == stem) or (room == "importers" and not function.startswith("_"))
    is_switch = name == "on" and function in ("freedrive", "light")  # methods of drivers, which others write
    is_operand = name == "other" and (function.startswith("__") or function in PUBLIC)
    is_side = name == "left" and "right" in listed
    return is_option or is_switch or is_operand or is_side


def constants(path: Path, place: str) -> Iterator[Name]:
    """Names in upper case that a module assigns."""
    for node in parsed(path).body:
        one_target = [node.target] if isinstance(node, ast.AnnAssign) else []
        targets = node.targets if isinstance(node, ast.Assign) else one_target
        for target in targets:
            each = target.elts if isinstance(target, ast.Tuple) else [target]
            yield from (
                Name("constant", place, node.lineno, one.id)
                for one in each
                if isinstance(one, ast.Name) and one.id.isupper() and len(one.id.strip("_")) > 1
            )


def is_participle(word: str) -> bool:
    """Whether a word is the past participle of a verb."""
    return word in IRREGULAR or (word.endswith("ed") and word not in NO_PARTICIPLES)


def fault(name: Name) -> str:
    """Return the fault of a name; empty if it has none."""
    bare = name.name.strip("_").lower()
    words = bare.split("_")
    if name.is_fixed or name.name.startswith("__") or not bare:
        return ""
    if name.kind == "test":
        return "a word that is replaced" if set(words) & REPLACED_IN_TESTS else ""
    if set(words) & REPLACED and name.kind != "parameter":
        return "a word that is replaced"
    if name.kind == "constant":
        return "does not say what it counts" if bare in VAGUE | NO_NAMES else ""
    if len(words) == 1:
        if is_participle(bare):
            return "a bare participle"
        return "neither a verb nor a noun" if bare in NO_NAMES else ""
    if name.kind == "function" and words[0] not in BUILDERS and "_from_" not in bare:
        if words[0] in NO_NAMES - {"few", "fewest", "many", "other", "near", "both", "whole", "some"}:
            return "begins with a preposition"
        ends_badly = is_participle(words[-1]) or words[-1] in NO_NAMES - {"between", "inside", "few", "fewest", "after"}
        return "ends with a participle or a preposition" if ends_badly else ""
    return ""


def literal(node: ast.expr) -> str:
    """The words of a string, each value that is filled in as `x`."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
    return ""


def docstrings() -> Iterator[Text]:
    """Docstrings of the package, without commands that they give as examples."""
    for path in sources():
        for node in nodes_of(parsed(path)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node)
                if text:
                    prose = re.sub(r"^ +basecal .*", "", text, flags=re.MULTILINE)
                    yield Text("docstring", str(path.relative_to(ROOT)), getattr(node, "lineno", 1), prose)


def messages() -> Iterator[Text]:
    """Strings of the package with at least four words that are no docstrings: messages, help and reports."""
    for path in sources():
        nodes = nodes_of(parsed(path))
        inner = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
        bare = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in (node for node in nodes if isinstance(node, ast.JoinedStr | ast.Constant)):
            is_whole = isinstance(node, ast.JoinedStr) or id(node) not in inner
            text = literal(node) if is_whole and id(node) not in bare else ""
            if len(re.findall(r"[A-Za-z]{2,}", text)) >= 4 and not re.search(r"[<>{}\\^]|\(\?|https?:", text):
                yield Text("message", str(path.relative_to(ROOT)), node.lineno, text)


def documents() -> Iterator[Text]:
    """Paragraphs of the documents: no code, tables, headings or formulas."""
    for path in [*(ROOT / place for place in DOCUMENTS), *sorted((ROOT / "docs").rglob("*.md"))]:
        hidden = re.compile(r"```.*?```|\$\$.*?\$\$|<!--.*?-->", re.DOTALL)
        text = hidden.sub(lambda match: "\n" * match[0].count("\n"), path.read_text(encoding="utf-8"))
        line = 1
        for block in text.split("\n\n"):
            kept = [each for each in block.split("\n") if not re.match(r"\s*(?:[|#>]|:::|    |!\[|<)", each)]
            if kept:
                yield Text("document", str(path.relative_to(ROOT)), line, "\n".join(kept))
            line += block.count("\n") + 2


def sentences(text: str) -> list[str]:
    """Sentences of a text, and items of its lists."""
    plain = re.sub(r"`[^`]*`|(?<!\$)\$[^$\n]+\$", "code", text)
    parts = re.split(r"(?<=[.?!])[*_)\"]*\s+|\n\s*(?:[-*]|\d+\.)\s+|\n\s*\n|\n(?=\s+\w+: )", plain)
    return [" ".join(part.split()) for part in parts if part.strip()]


def word_count(sentence: str) -> int:
    """Number of words and numbers."""
    return len([word for word in sentence.split() if re.search(r"\w", word)])


def replacement(found: re.Match[str]) -> str:
    """What is written instead of a phrase."""
    return next(good for bad, good in PHRASES.items() if re.match(bad, found[0], re.IGNORECASE))


def complaints(texts: Iterator[Text]) -> Iterator[tuple[Text, str, str]]:
    """Each sentence with what is wrong with it."""
    for text in texts:
        most = MESSAGE_WORDS if text.kind == "message" else DOCUMENT_WORDS
        if text.kind == "docstring" and (first := text.text.split()[0].rstrip(",:")) in NO_FIRST_WORDS:
            yield text, f"begins with `{first}`, not with a verb or a noun", text.text.partition("\n")[0]
        for sentence in sentences(text.text):
            if (count := word_count(sentence)) > most:
                yield text, f"{count} words, at most {most}", sentence
            elif found := PRIVATE.search(sentence):
                yield text, f"for `{found[0]}` write {replacement(found)}", sentence


def draw(count: int, seed: int) -> Iterator[Text]:
    """Draw `count` docstrings and as many messages at random."""
    for texts in (docstrings(), messages()):
        yield from random.Random(seed).sample(list(texts), count)


def main() -> None:
    """Print names, sentences or a random sample of texts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("names", "sentences", "draw"))
    parser.add_argument("--faults", action="store_true", help="only names that are wrong")
    parser.add_argument("--draw", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.what == "names":
        for name in names():
            if (why := fault(name)) or not arguments.faults:
                print(f"{name.path}:{name.line}: {name.kind} {name.name}" + (f": {why}" if why else ""))
    elif arguments.what == "sentences":
        for text, why, sentence in complaints(iter([*docstrings(), *messages(), *documents()])):
            print(f"{text.path}:{text.line}: {text.kind}, {why}: {sentence}")
    else:
        for text in draw(arguments.draw, arguments.seed):
            print(f"{text.path}:{text.line}: {text.kind}: {' '.join(text.text.split())}")


if __name__ == "__main__":
    main()
