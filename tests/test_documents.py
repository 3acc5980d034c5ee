"""Tests of the documents: equations, reference and glossary agree with the code; nothing is loaded from outside."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import basecal
from basecal.acquisition.drivers.registry import DRIVERS
from basecal.exchange.controllers.convention import (
    DEGREE,
    METRE,
    MILLIMETRE,
    RADIAN,
    Convention,
    MatrixConvention,
)
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.registry import IMPORTERS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SOURCES = sorted((ROOT / "src" / "basecal").rglob("*.py"))
TAG = re.compile(r"\\tag\{(\d+\.\d+)\}")
CITATION = re.compile(r'docs/mathematics\.md((?:(?:,? and|,|-)? ?\(\d+\.\d+\))+|, "[^"]+")?')


def equations() -> list[str]:
    """Numbers of the equations in docs/mathematics.md, in order."""
    return TAG.findall((DOCS / "mathematics.md").read_text(encoding="utf-8"))


def cited(text: str, known: list[str]) -> Iterator[str]:
    """Equations cited by a text: single ones, and ranges such as (2.4)-(2.6)."""
    for found in CITATION.finditer(" ".join(text.split())):
        for first, last in re.findall(r"\((\d+\.\d+)\)(?:-\((\d+\.\d+)\))?", found[1] or ""):
            yield first
            if last:
                yield last
                inside = slice(known.index(first), known.index(last)) if {first, last} <= set(known) else slice(0)
                yield from known[inside]


def test_equation_numbers_are_unique_and_ascending() -> None:
    """No number occurs twice, and the numbers of a section count up from one."""
    sections: dict[int, list[int]] = {}
    for number in equations():
        section, place = map(int, number.split("."))
        sections.setdefault(section, []).append(place)
    assert list(sections) == sorted(sections)
    for section, places in sections.items():
        counted = list(range(1, len(places) + 1))
        assert places == counted, f"docs/mathematics.md: number the equations of section {section} in their order"


def test_code_and_mathematics_cite_the_same_equations() -> None:
    """Every equation that a docstring cites exists, and every equation is cited by the code that computes it."""
    known = equations()
    places: dict[str, str] = {}
    for path in SOURCES:
        places |= dict.fromkeys(cited(path.read_text(encoding="utf-8"), known), path.name)
    missing = [f"({number}) of {name}" for number, name in places.items() if number not in known]
    assert not missing, f"docs/mathematics.md has no equation {', '.join(missing)}"
    bare = [f"({number})" for number in known if number not in places]
    assert not bare, f"cite in the docstring of what computes it, by `docs/mathematics.md (N.N)`: {', '.join(bare)}"


def test_every_citation_names_an_equation_or_heading() -> None:
    """Each citation of the mathematics names an existing equation or heading."""
    page = (DOCS / "mathematics.md").read_text(encoding="utf-8")
    where = {(path.name, found[1]) for path in SOURCES for found in CITATION.finditer(path.read_text(encoding="utf-8"))}
    assert {(name, place) for name, place in where if not place} == set()
    named = {place[3:-1] for _, place in where if place.startswith(', "')}
    assert {name for name in named if name not in page} == set()


def test_ranges_of_citations_are_parsed() -> None:
    """Lists, ranges and line breaks within citations are parsed."""
    known = ["1.1", "1.2", "1.3", "2.1"]
    text = "Source: docs/mathematics.md\n    (1.1)-(1.3), (2.1). Not (3.1)."
    assert set(cited(text, known)) == set(known)


def test_equations_cited_in_the_mathematics_exist() -> None:
    """The page of mathematics cites only its own equations."""
    page = (DOCS / "mathematics.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\((\d+\.\d+)\)", page)) <= set(equations())


def test_reference_lists_every_public_name() -> None:
    """The page of public names has each name of `basecal.__all__` once, with its module."""
    listed = re.findall(r"^::: (\S+)$", (DOCS / "api" / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    at_home = [f"{getattr(basecal, name).__module__}.{name}" for name in basecal.__all__]
    missing, unknown = set(at_home) - set(listed), set(listed) - set(at_home)
    assert not missing, f"add to docs/api/index.md, each by a line `::: NAME`: {sorted(missing)}"
    assert not unknown, f"remove from docs/api/index.md, or add to basecal.__all__: {sorted(unknown)}"
    assert len(listed) == len(at_home)


def test_functions_in_the_public_reference_exist() -> None:
    """Public functions are named alone, others with their module."""
    text = (DOCS / "api" / "index.md").read_text(encoding="utf-8")
    names = re.findall(r"`([a-z_][a-z_.]*)`", text)
    assert names
    for name in names:
        module, _, function = f"basecal.{name}".rpartition(".") if "." not in name else name.rpartition(".")
        assert hasattr(import_module(module), function), name


def test_reference_has_every_package() -> None:
    """Each package except the command line has a page."""
    packages = {path.parent.name for path in (ROOT / "src" / "basecal").glob("*/__init__.py")} - {"cli"}
    pages = {path.stem for path in (DOCS / "api").glob("*.md")} - {"index"}
    assert pages == packages, f"docs/api has one page a package: {sorted(pages ^ packages)}"


def test_glossary_has_ten_words() -> None:
    """No word is explained twice, words are in alphabetical order, and all other words are the field's."""
    page = (DOCS / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^\| ([^|]+?) \|", page, re.MULTILINE)[2:]
    assert words == sorted(set(words))
    assert len(words) <= 10


def test_every_import_is_documented() -> None:
    """Each kind of import has its section in the order of the registry; there are no other sections."""
    page = (DOCS / "importing.md").read_text(encoding="utf-8")
    described = re.findall(r"^## `(.+)`$", page, re.MULTILINE)
    assert described == list(IMPORTERS), "docs/importing.md: one heading ## `KIND` for each, in the registry's order"


def test_every_driver_is_documented() -> None:
    """The table has each driver with all options; a section describes each option with its default."""
    rows = dict(re.findall(r"^\| `(\w+)` \| (?:both|robots|cameras) \| (.+?) \|", page("data_format.md"), re.MULTILINE))
    assert list(rows) == list(DRIVERS), "docs/data_format.md: one row for each driver, in the registry's order"
    for name in DRIVERS:
        assert [option for option in options_of(name) if f"`{option}`" not in rows[name]] == []
    for section in page("drivers.md").split("\n## ")[1:]:
        options = re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
        assert options == list(options_of(section.split("`")[1]))


def options_of(driver: str) -> dict[str, Any]:
    """Fields of a driver's options by name, which its module defines or imports as `<Driver>Options`."""
    module = import_module(f"basecal.acquisition.drivers.{driver}")
    options = getattr(module, f"{driver.capitalize()}Options", None)
    return {} if options is None else dict(options.model_fields)


def page(name: str) -> str:
    """A page of the documents."""
    return (DOCS / name).read_text(encoding="utf-8")


def test_every_extra_is_documented() -> None:
    """Each extra of the package occurs in a table or a sentence of the documents."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    text = " ".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.md"))
    assert [name for name in extras if f"extra `{name}`" not in text and f"| `{name}` |" not in text] == []


def test_every_format_is_documented_with_its_numbers_and_units() -> None:
    """The table of formats has each controller with its columns, length unit and angle convention."""
    page = (DOCS / "importing.md").read_text(encoding="utf-8")
    rows = {row[0]: row[1:] for row in re.findall(r"^\| `(\w+)` \| (.+?) \| (m|mm) \| (.+?) \|$", page, re.MULTILINE)}
    assert list(rows) == list(CONTROLLERS)
    for name, (numbers, length, rotation) in rows.items():
        how = CONTROLLERS[name]
        many = f"{how.names[0]} to {how.names[-1]}"
        assert numbers == (many if isinstance(how, MatrixConvention) else ", ".join(how.names))
        assert {"m": METRE, "mm": MILLIMETRE}[length] == how.length
        if isinstance(how, Convention) and "quaternion" not in how.form.words:
            assert {"rad": RADIAN, "deg": DEGREE}[rotation.split(", ")[-1]] == how.angle


def test_documents_load_no_external_files() -> None:
    """No page, style or setting names a script, style, font or image on another server."""
    loading = re.compile(r"""(?:src=|<link[^>]*href=|url\(|@import|!\[[^]]*\]\()\s*["']?(?:https?:)?//""")
    files = [*DOCS.rglob("*.md"), *DOCS.rglob("*.css"), *DOCS.rglob("*.svg"), *DOCS.rglob("*.py"), ROOT / "mkdocs.yml"]
    assert [str(path) for path in files if loading.search(path.read_text(encoding="utf-8"))] == []
    assert "font: false" in (ROOT / "mkdocs.yml").read_text(encoding="utf-8")


def luminance(colour: str) -> float:
    """Relative luminance of `#rrggbb`, as WCAG 2 defines it."""
    parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_colours_of_code_have_contrast() -> None:
    """The contrast with the theme's background of code is at least 4.5, light and dark."""
    style = (DOCS / "assets" / "site.css").read_text(encoding="utf-8")
    for scheme, background in (("default", "#f5f5f5"), ("slate", "#272a35")):
        block = style.partition(f'[data-md-color-scheme="{scheme}"]')[2].partition("}")[0]
        colours = re.findall(r"#[0-9a-f]{6}", block)
        assert len(colours) >= 2
        for colour in colours:
            dark, bright = sorted((luminance(colour), luminance(background)))
            assert (bright + 0.05) / (dark + 0.05) >= 4.5, colour
