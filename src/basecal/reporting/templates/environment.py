"""Rendering of pages that open offline: escaping templates, and a strict Content-Security-Policy."""

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

from basecal.fields.digits import two_digits

_FOLDER = files("basecal.reporting")
_COMPRESSION = 6  # level: half a percent larger than the highest, in two thirds of its time
_SCENE_SCRIPTS = ("vendor/three.min.js", "templates/scene.js")


class TemplateCache(FileSystemBytecodeCache):
    """A cache of compiled templates in a folder, by default beside Python's compiled modules."""

    def __init__(self, folder: Path = Path(__file__).parent / "__pycache__") -> None:
        super().__init__(str(folder), "%s.jinja")

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store a compiled template, if Python may write bytecode and the folder is writable."""
        if not sys.dont_write_bytecode:
            with suppress(OSError):
                super().dump_bytecode(bucket)


def read_package_file(name: str) -> str:
    """Text of a file of the package `reporting`."""
    return _FOLDER.joinpath(name).read_text(encoding="utf-8")


@lru_cache
def environment() -> Environment:
    """The environment of this package's templates, which escapes all values."""
    loader = FunctionLoader(lambda name: read_package_file(f"templates/{name}"))
    # A page is rendered once, for which optimisation of its template takes longer.
    result = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        optimized=False,
        bytecode_cache=TemplateCache(),
    )
    result.filters["words"] = _mark_code
    result.filters["sentence"] = _begin_sentence
    result.filters["two_digits"] = two_digits
    result.filters["breakable"] = lambda name: escape(name).replace("_", Markup("_<wbr>"))
    return result


def fill_part(template: str, **values: Any) -> str:
    """Render a template with values."""
    return environment().get_template(template).render(values)


def fill_page(template: str, scripts: Sequence[str] = (), is_served: bool = False, **values: Any) -> str:
    """Render a template as a page with its style, scripts and Content-Security-Policy.

    Args:
        template: File name of the template.
        scripts: Files of its scripts; the script of the scene is added if `values` has `scene_json`.
        is_served: Whether the page may send requests to its server.
        values: Values for the template.
    """
    style, sources = read_package_file("templates/page.css"), list(map(read_package_file, scripts))
    scene, packed = [], ""
    if values.setdefault("scene_json", ""):
        source, packed = _packed_scene()
        sources.insert(0, read_package_file("templates/unpack.js"))
        scene.append(source)
    allowed = policy(style, sources + scene, is_served)
    marked = list(map(Markup, sources))
    return fill_part(template, style=Markup(style), scripts=marked, policy=allowed, packed=packed, **values)


@lru_cache
def _packed_scene() -> tuple[str, str]:
    """Script of the scene, and its compressed form, a quarter of the size, which runs after the page is painted."""
    source = "\n".join(map(read_package_file, _SCENE_SCRIPTS))
    return source, base64.b64encode(gzip.compress(source.encode(), _COMPRESSION, mtime=0)).decode()


def _mark_code(text: str) -> Markup:
    """Convert text between backticks to code elements."""
    parts = text.split("`")
    if len(parts) % 2 == 0:
        return escape(text)
    return Markup().join(
        escape(part) if k % 2 == 0 else Markup("<code>{}</code>").format(part) for k, part in enumerate(parts)
    )


def _begin_sentence(text: str) -> str:
    """Text with a capital first letter; names of transforms and code are unchanged."""
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


def policy(style: str, scripts: Sequence[str] = (), is_served: bool = False) -> str:
    """The Content-Security-Policy: only the given scripts run, and only the page's own server may be contacted."""
    allowed = " ".join(_source_hash(script) for script in scripts) or "'none'"
    own = f"script-src {allowed}; style-src {_source_hash(style)}; img-src data:"
    more = " connect-src 'self';" if is_served else ""
    return f"default-src 'none';{more} {own}; base-uri 'none'; form-action 'none'"


def _source_hash(source: str) -> str:
    digest = base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()
    return f"'sha256-{digest}'"
