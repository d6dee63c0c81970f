"""A reading that the judge, a case or a probe finds is in the results."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.core import ControllerCore

RunCases = Callable[..., Any]


@pytest.mark.parametrize(
    ("key", "option", "tried_by"),
    [
        (
            "endian",
            "big",
            "5.1/9",
        ),  # the judge observes it, although a probe finds that both are accepted
        ("pipelining", "any-order", "3/24"),  # a rule of the judge tolerates it
        ("resync", "close", "3/19"),  # a case tolerates it
        ("max_clients", "newest", "2/12"),  # a probe finds it, and a case tolerates it
    ],
)
def test_observed_reading_is_reported(
    run_cases: RunCases, key: str, option: str, tried_by: str
) -> None:
    """Only the observed option is reported."""
    found = run_cases(ControllerCore, tried_by, actual=DEFAULT.replace(**{key: option})).readings[
        key
    ]
    assert (found.options, found.default, found.mixed) == ((option,), False, False)


def test_sent_byte_order_contradicts_the_claim(run_cases: RunCases) -> None:
    """A controller that accepts both byte orders and sends the other fails its claim (A-5-2)."""
    claims = {"dialect": DEFAULT, "claimed": frozenset({"endian"})}
    cases = run_cases(ControllerCore, "5.1/9", actual=DEFAULT.replace(endian="big"), **claims)
    assert cases["claim.endian"].verdict is Verdict.FAIL
    assert "claim.endian" not in run_cases(ControllerCore, "5.1/9", **claims)
