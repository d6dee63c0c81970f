"""Sending: what a client sends for an order, held against what it was ordered.

Numbers are compared as numbers, since 200 and 200.0 are the same (A-T-5). What a client had better
refuse, or has no value for, is met here too. No requirement is judged.
"""

import math
import re
from collections.abc import Sequence
from decimal import Decimal
from typing import Final

from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import OperationRefused, expect, show_value
from scaraspec.user_message import UserMessage

_DECIMAL: Final = re.compile(rb"-?[0-9]+(\.[0-9]+)?")
_NEAR: Final = 5e-4  # nobody need write more than three decimals (A-T-5)
_SINGLE: Final = 1e-7  # the relative error of 32 bits


def numbers_in(answer: ReceivedFrame) -> list[float] | None:
    """The numbers between the bars of a request; None where one of them is none."""
    texts = answer.seen.text.removesuffix(b"|").split(b"|")  # a bar may end them (A-T-4)
    if not all(_DECIMAL.fullmatch(text) for text in texts):
        return None
    return [float(text) for text in texts]


def is_near(sent: float, expected: float) -> bool:
    """Whether a number was sent for another one."""
    return math.isclose(sent, expected, rel_tol=_SINGLE, abs_tol=_NEAR)


def to_decimal_text(number: float) -> str:
    """A number without an exponent (T/5), in as many digits as it was meant to have."""
    return f"{Decimal(f'{number:.15g}'):f}"


def expect_numbers(
    answer: ReceivedFrame, expected: Sequence[float], *, requirement: str = ""
) -> None:
    """Fail the client unless a request carries these numbers, in this order.

    Raises:
        CaseFailed: It carries something else.
    """
    sent = numbers_in(answer)
    expect(
        sent is not None and len(sent) == len(expected) and all(map(is_near, sent, expected)),
        UserMessage("what {seen} carries", seen=answer.seen.name),
        expected="|".join(map(to_decimal_text, expected)),
        observed=show_value(answer.frame.data),
        requirement=requirement,
    )


def request_unless_refused(
    line: IncomingConnection, call: Call, *, within_s: float | None = None
) -> ReceivedFrame | None:
    """The request of an order that the client had better not carry out; None where it does not.

    Args:
        line: Where it would come.
        call: The order.
        within_s: How long to wait; by default as long as the client may think.

    Raises:
        NoReply: It neither sends anything nor says that it will not.
        CaseFailed: It says that it was done, and has sent nothing.
    """
    try:
        return line.request(call.name, call, within_s=within_s)
    except OperationRefused:
        return None


def expect_no_value(subject: ClientUnderTest, call: Call, *, requirement: str = "") -> None:
    """Fail the client unless it says that there is no value, by an error or by none at all.

    Raises:
        CaseFailed: It gives one.
    """
    if not subject.access.attended and subject.wait_for_answer(call).ok and call.result is None:
        return
    subject.expect_failure(call, requirement=requirement)
