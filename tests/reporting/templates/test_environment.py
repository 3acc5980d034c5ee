"""Tests of the templates of pages that open offline."""

from __future__ import annotations

import base64
import hashlib
import re
import sys
from pathlib import Path

import pytest
from jinja2 import Environment, UndefinedError

from basecal.cell import BudgetEntry
from basecal.reporting.decision.tiles import error_tile
from basecal.reporting.svg import element
from basecal.reporting.templates.environment import TemplateCache, environment, policy, read_package_file


def render_macro(macro: str, *values: object) -> str:
    """Render a macro of the page's parts."""
    return str(getattr(environment().get_template("parts.html").module, macro)(*values))


def test_budget_bar_parts_have_their_shares() -> None:
    """The parts follow one another. A small one has no number inside, and all have a tooltip."""
    shares = (("a<", 0.75), ("b", 0.2), ("c", 0.05))
    bar = render_macro("budget_bar", [BudgetEntry(name, 1e-3, share, 1e-3) for name, share in shares])
    assert [float(found) for found in re.findall(r' x="([0-9.]+)" width', bar)] == [0.0, 480.0, 608.0]
    assert [float(found) for found in re.findall(r'width="([0-9.]+)" height="34"', bar)] == [480.0, 128.0, 32.0]
    assert re.findall(r">(\d+ %)</text>", bar) == ["75 %", "20 %"]
    assert "<title>a&lt;: 75 %</title>" in bar


def test_tolerance_is_a_line_at_the_bar() -> None:
    """The line is right of the bar if the tolerance is met, and on it if it is missed.

    Without a tolerance there is neither.
    """
    shown = render_macro("tile_list", [error_tile(4e-4, 1e-3)])
    assert '<rect class="within" width="38.1"' in shown
    assert 'd="M95.2 0V8"' in shown
    assert "<title>expected error 0.40 mm, tolerance 1 mm</title>" in shown
    assert "<svg" not in render_macro("tile_list", [error_tile(4e-4, None)])
    assert render_macro("tile_list", []).strip() == ""


def test_template_values_are_escaped() -> None:
    """Text is escaped and text between backticks is code; drawings are inserted unchanged."""
    made = environment()
    template = "{{ a }} {{ a | words }} {{ b }}"
    shown = made.from_string(template).render(a="<i> `x<y`", b=element("svg"))
    assert shown == "&lt;i&gt; `x&lt;y` &lt;i&gt; <code>x&lt;y</code> <svg></svg>"
    assert made.from_string("{{ a | words }}").render(a="odd ` tick") == "odd ` tick"


def test_missing_template_value_is_an_error() -> None:
    """A mistake in a template raises an error."""
    with pytest.raises(UndefinedError):
        environment().from_string("{{ missing }}").render()


def test_policy_has_hashes_of_scripts_and_style() -> None:
    """The policy has the hash of each script and of the style, and no address."""
    script, style = read_package_file("templates/page.js"), read_package_file("templates/page.css")
    text_of_policy = policy(style, [script])
    for text in (script, style):
        assert base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() in text_of_policy
    assert text_of_policy.startswith("default-src 'none'; ")
    assert "http" not in text_of_policy
    assert "script-src 'none'" in policy(style)
    assert "connect-src" not in text_of_policy
    assert "connect-src 'self'" in policy(style, [script], is_served=True)


def test_templates_are_compiled_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Another process reads the compiled template, until the template changes."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    kept = TemplateCache(tmp_path)
    bucket = kept.get_bucket(Environment(), "page", None, "{{ a }}")
    bucket.code = compile("b = 1", "page", "exec")
    kept.set_bucket(bucket)
    assert TemplateCache(tmp_path).get_bucket(Environment(), "page", None, "{{ a }}").code == bucket.code
    assert TemplateCache(tmp_path).get_bucket(Environment(), "page", None, "{{ b }}").code is None


@pytest.mark.parametrize("is_refused", [True, False])
def test_templates_work_without_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, is_refused: bool) -> None:
    """Neither a missing folder nor Python's own switch against bytecode makes a page fail."""
    monkeypatch.setattr(sys, "dont_write_bytecode", is_refused)
    folder = tmp_path if is_refused else tmp_path / "missing"
    made = environment().overlay(bytecode_cache=TemplateCache(folder))
    assert made.get_template("sheet.svg").root_render_func is not None
    assert list(tmp_path.iterdir()) == []


def test_sentences_begin_with_a_capital_letter() -> None:
    """Sentences begin with a capital letter unless they begin with a name or code.

    Code between backticks alternates with words.
    """
    made = environment()
    shown = made.from_string("{{ a | sentence }}|{{ b | sentence }}|{{ c | words }}|{{ d | breakable }}")
    assert shown.render(a="it moved", b="hand_base moved", c="`a` or `b`", d="a_from_b") == (
        "It moved|hand_base moved|<code>a</code> or <code>b</code>|a_<wbr>from_<wbr>b"
    )
