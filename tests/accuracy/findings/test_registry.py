"""Tests that docs/findings.md and the registry list exactly the findings of the source."""

from __future__ import annotations

import re
from pathlib import Path

from basecal.accuracy.findings import registry

ROOT = Path(__file__).parents[3]
FINDINGS = ROOT / "src" / "basecal" / "accuracy" / "findings"
# A code is a string literal and the first argument of a finding or a hypothesis.
CODE = re.compile(r"(?:Finding|ConventionHypothesis|Words)\(\s*\"([a-z0-9-]+)\"")


def codes_in_source() -> set[str]:
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    return {code for text in texts for code in CODE.findall(text)}


def documented_codes() -> set[str]:
    text = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    return set(re.findall(r"^#+ `([a-z0-9-]+)`", text, re.MULTILINE))


def test_codes_equal_documented_headings():
    """Codes in the source equal the headings of docs/findings.md."""
    made, described = codes_in_source(), documented_codes()
    assert not made - described, f"describe in docs/findings.md, by a heading `### `CODE``: {sorted(made - described)}"
    assert not described - made, f"remove from docs/findings.md, nothing makes them: {sorted(described - made)}"


def test_every_check_is_registered():
    """Each file of findings except the registry and its types gives a check that the registry lists."""
    listed = {check.__module__.rpartition(".")[2] for check in (*registry.INPUT_CHECKS, *registry.ANSWER_CHECKS)}
    unlisted = {path.stem for path in FINDINGS.glob("*.py")} - {"__init__", "evidence", "registry"} - listed
    assert not unlisted, f"add to INPUT_CHECKS or ANSWER_CHECKS of findings/registry.py: {sorted(unlisted)}"
