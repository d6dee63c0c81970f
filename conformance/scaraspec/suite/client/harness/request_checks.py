"""Request checks: compare what a client sends with the values of the operation.

Numbers are compared as numbers, because 200 and 200.0 are equal (A-T-5). Operations that a client
should refuse, or that return no value, are handled here too. No requirement is judged.
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
_NEAR: Final = 5e-4  # three decimals are enough (A-T-5)
_SINGLE: Final = 1e-7  # the relative error of 32 bits


def numbers_in(answer: ReceivedFrame) -> list[float] | None:
    """Return the numbers between the bars of a request; None if a field is not a number."""
    texts = answer.seen.text.removesuffix(b"|").split(b"|")  # a bar may end them (A-T-4)
    if not all(_DECIMAL.fullmatch(text) for text in texts):
        return None
    return [float(text) for text in texts]


def is_near(sent: float, expected: float) -> bool:
    """Whether the number sent stands for the expected number."""
    return math.isclose(sent, expected, rel_tol=_SINGLE, abs_tol=_NEAR)


def to_decimal_text(number: float) -> str:
    """Return a number without an exponent (T/5), with at most 15 significant digits."""
    return f"{Decimal(f'{number:.15g}'):f}"


def expect_numbers(
    answer: ReceivedFrame, expected: Sequence[float], *, requirement: str = ""
) -> None:
    """Require that a request carries these numbers, in this order.

    Raises:
        CaseFailed: It carries something else.
    """
    sent = numbers_in(answer)
    expect(
        sent is not None and len(sent) == len(expected) and all(map(is_near, sent, expected)),
        UserMessage("the request {command} carries wrong numbers", command=answer.seen.name),
        expected="|".join(map(to_decimal_text, expected)),
        observed=show_value(answer.frame.data),
        requirement=requirement,
    )


def request_unless_refused(
    line: IncomingConnection, call: Call, *, within_s: float | None = None
) -> ReceivedFrame | None:
    """Return the request of an operation that a client should refuse; None if it refuses.

    Args:
        line: The connection.
        call: The operation.
        within_s: The timeout in seconds; by default the answer timeout.

    Raises:
        NoReply: The client neither sends a request nor reports a refusal.
        CaseFailed: The client reports success without a request.
    """
    try:
        return line.request(call.name, call, within_s=within_s)
    except OperationRefused:
        return None


def expect_no_value(subject: ClientUnderTest, call: Call, *, requirement: str = "") -> None:
    """Require that the client reports an error or no value.

    Raises:
        CaseFailed: It reports a value.
    """
    if not subject.access.attended and subject.wait_for_answer(call).ok and call.result is None:
        return
    subject.expect_failure(call, requirement=requirement)
