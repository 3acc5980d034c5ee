"""Pages that open offline."""

from __future__ import annotations

import base64
import hashlib

import pytest
from jinja2 import UndefinedError

from basecal.reporting.templates.environment import environment, own_file, policy


def test_what_is_given_is_escaped() -> None:
    """Words cannot become markup; between backticks they are what to type; drawings stay drawings."""
    made = environment()
    said = "{{ a }} {{ a | words }} {{ b | svg }}"
    shown = made.from_string(said).render(a="<i> `x<y`", b="<svg/>")
    assert shown == "&lt;i&gt; `x&lt;y` &lt;i&gt; <code>x&lt;y</code> <svg/>"
    assert made.from_string("{{ a | words }}").render(a="odd ` tick") == "odd ` tick"


def test_what_is_not_given_is_an_error() -> None:
    """A slip in a template is told."""
    with pytest.raises(UndefinedError):
        environment().from_string("{{ missing }}").render()


def test_the_policy_names_what_may_run() -> None:
    """The hash of each script and of the style, and no address."""
    script, style = own_file("templates/page.js"), own_file("templates/page.css")
    said = policy(style, [script])
    for text in (script, style):
        assert base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() in said
    assert said.startswith("default-src 'none'; ")
    assert "http" not in said
    assert "script-src 'none'" in policy(style)
    assert "connect-src" not in said
    assert "connect-src 'self'" in policy(style, [script], is_served=True)
