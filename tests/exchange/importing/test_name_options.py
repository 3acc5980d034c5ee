"""Options of the form NAME=WORDS."""

from __future__ import annotations

import pytest

from basecal.errors import UsageError
from basecal.exchange.importing.name_options import parse_name_options


def test_words_stand_by_their_names():
    """What comes behind the first equals sign is the words, whatever is in them."""
    assert parse_name_options("--robot", ["left=a,b", "right=/x=y"], "NAME=WORDS") == {"left": "a,b", "right": "/x=y"}


@pytest.mark.parametrize(
    ("given", "error"),
    [(["left"], "expected NAME=WORDS"), (["=a"], "expected NAME=WORDS"), (["a=b", "a=c"], "given twice")],
)
def test_what_has_another_form(given, error):
    """No name, no words, and the same name twice."""
    with pytest.raises(UsageError, match=f"--robot .*: {error}"):
        parse_name_options("--robot", given, "NAME=WORDS")
