"""What is found out at an open point of the document is in the results, whoever found it out."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.core import ControllerCore

Try = Callable[..., Any]


@pytest.mark.parametrize(
    ("key", "option", "tried_by"),
    [
        ("endian", "big", "5.1/9"),  # the judge sees it, though a probe found that both are taken
        ("pipelining", "any-order", "3/24"),  # a rule of the judge tolerates it
        ("resync", "close", "3/19"),  # a case tolerates it
        ("max_clients", "newest", "2/12"),  # a probe finds it, and a case tolerates it
    ],
)
def test_another_reading_than_the_default_is_reported(
    tried: Try, key: str, option: str, tried_by: str
) -> None:
    """As the only one that was seen."""
    found = tried(ControllerCore, tried_by, spoken=DEFAULT.replace(**{key: option})).readings[key]
    assert (found.options, found.default, found.mixed) == ((option,), False, False)


def test_what_is_sent_outweighs_what_is_taken(tried: Try) -> None:
    """Who takes both byte orders and sends the other has made a wrong claim (A-5-2)."""
    claims = {"dialect": DEFAULT, "claimed": frozenset({"endian"})}
    cases = tried(ControllerCore, "5.1/9", spoken=DEFAULT.replace(endian="big"), **claims)
    assert cases["claim.endian"].verdict is Verdict.FAIL
    assert "claim.endian" not in tried(ControllerCore, "5.1/9", **claims)
