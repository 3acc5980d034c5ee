"""Formulas of the documents as MathML, made when the site is built, and names for readers of screens."""

from __future__ import annotations

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

_INLINE = re.compile(r'<span class="arithmatex">\\\((.+?)\\\)</span>', re.DOTALL)
_DISPLAY = re.compile(r'<div class="arithmatex">\s*\\\[(.+?)\\\]\s*</div>', re.DOTALL)
_TAG = re.compile(r"\\tag\{(\d+\.\d+)\}")
_BAR = '<mo stretchy="false">&#x0007C;</mo>'  # of a norm, and no operator between others
_CITED = re.compile(r"\((\d+\.\d+)\)(?![^<]*</a>)")


def on_page_content(html: str, page: object, **_: object) -> str:
    """The page with its formulas typeset, each numbered equation an anchor to which its mentions on the page lead."""
    numbers = set(_TAG.findall(html))
    linked = _CITED.sub(lambda found: _link(found[1]) if found[1] in numbers else found[0], html)
    shown = _DISPLAY.sub(lambda found: _equation(unescape(found[1])), linked)
    return _INLINE.sub(lambda found: _mathml(unescape(found[1]), "inline"), shown)


def on_post_page(output: str, **_: object) -> str:
    """The page with a name for the dialog of its search, which readers of screens need."""
    return output.replace('role="dialog"', 'role="dialog" aria-label="Search"')


def _link(number: str) -> str:
    return f'<a href="#eq-{number}">({number})</a>'


def _equation(latex: str) -> str:
    """A displayed formula of one or several lines, numbered where it has a tag."""
    tagged = _TAG.search(latex)
    lines = "".join(_mathml(line, "block") for line in _TAG.sub("", latex).split(r"\\"))
    if tagged is None:
        return f'<div class="equation"><div>{lines}</div></div>'
    number = tagged[1]
    return f'<div class="equation" id="eq-{number}"><div>{lines}</div><a href="#eq-{number}">({number})</a></div>'


def _mathml(latex: str, display: str) -> str:
    """One formula as MathML.

    Raises:
        PluginError: if part of it is not understood.
    """
    made = convert(latex.strip(), display=display)
    if "\\" in made or re.search(r"&(?!#x[0-9A-F]+;|[a-z]+;)", made):
        raise PluginError(f"a formula that latex2mathml does not understand: {latex.strip()}")
    return made.replace(_BAR, _BAR.replace("<mo", '<mo lspace="0" rspace="0"'))
