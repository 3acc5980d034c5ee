"""Pages that open offline: templates that escape what they are given, and a policy that lets nothing else in."""

from __future__ import annotations

import base64
import gzip
import hashlib
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemBytecodeCache, FunctionLoader, StrictUndefined
from jinja2.bccache import Bucket
from markupsafe import Markup, escape

_FOLDER = files("basecal.reporting")
_COMPRESSION = 6  # level, which is half a percent larger than the highest in two thirds of its time
_SCENE_SCRIPTS = ("vendor/three.min.js", "templates/scene.js")


class BesideModules(FileSystemBytecodeCache):
    """Compiled templates in a folder, where Python's own compiled modules are, if these may be written there."""

    def __init__(self, folder: Path = Path(__file__).parent / "__pycache__") -> None:
        super().__init__(str(folder), "%s.jinja")

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template; one that cannot be kept is compiled again next time."""
        if not sys.dont_write_bytecode:
            with suppress(OSError):
                super().dump_bytecode(bucket)


def own_file(name: str) -> str:
    """A file of the package `reporting` as text."""
    return _FOLDER.joinpath(name).read_text(encoding="utf-8")


@lru_cache
def environment() -> Environment:
    """Templates of this package; whatever they are given is escaped."""
    loader = FunctionLoader(lambda name: own_file(f"templates/{name}"))
    # A page is filled in once: to optimise its template first takes longer.
    made = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        optimized=False,
        bytecode_cache=BesideModules(),
    )
    made.filters["words"] = _mark_code
    made.filters["sentence"] = _begin_sentence
    made.filters["breakable"] = lambda name: escape(name).replace("_", Markup("_<wbr>"))
    return made


def fill_part(template: str, **values: Any) -> str:
    """A template with values."""
    return environment().get_template(template).render(values)


def fill_page(template: str, scripts: Sequence[str] = (), is_served: bool = False, **values: Any) -> str:
    """A template as a page that holds the style, its scripts, and a policy that lets nothing else in.

    Args:
        template: Its file.
        scripts: Files that it runs; what draws a scene is added if `values` have `scene_json`.
        is_served: Whether it asks the program that serves it for more.
        values: What the template names.
    """
    style, sources = own_file("templates/page.css"), list(map(own_file, scripts))
    scene, packed = [], ""
    if values.setdefault("scene_json", ""):
        source, packed = _packed_scene()
        sources.insert(0, own_file("templates/unpack.js"))
        scene.append(source)
    allowed = policy(style, sources + scene, is_served)
    marked = list(map(Markup, sources))
    return fill_part(template, style=Markup(style), scripts=marked, policy=allowed, packed=packed, **values)


@lru_cache
def _packed_scene() -> tuple[str, str]:
    """Script and data of a scene, and the same compressed: a quarter of the size, read after the page is painted."""
    source = "\n".join(map(own_file, _SCENE_SCRIPTS))
    return source, base64.b64encode(gzip.compress(source.encode(), _COMPRESSION, mtime=0)).decode()


def _mark_code(text: str) -> Markup:
    """Words whose parts between backticks are what to type."""
    parts = text.split("`")
    if len(parts) % 2 == 0:
        return escape(text)
    return Markup().join(
        escape(part) if k % 2 == 0 else Markup("<code>{}</code>").format(part) for k, part in enumerate(parts)
    )


def _begin_sentence(text: str) -> str:
    """Words with a capital letter first; names of transforms and code stay as they are."""
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


def policy(style: str, scripts: Sequence[str] = (), is_served: bool = False) -> str:
    """The Content-Security-Policy: nothing runs but these scripts, nothing is fetched but from where it is served."""
    allowed = " ".join(_source_hash(script) for script in scripts) or "'none'"
    own = f"script-src {allowed}; style-src {_source_hash(style)}; img-src data:"
    more = " connect-src 'self';" if is_served else ""
    return f"default-src 'none';{more} {own}; base-uri 'none'; form-action 'none'"


def _source_hash(source: str) -> str:
    digest = base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()
    return f"'sha256-{digest}'"
