"""Expect: how a case says that its subject did wrong, or that it could not find out.

Every check names what the document leads to expect and what was there instead. A case that returns
has passed; one that raises something else than what is here has a mistake of its own.
"""

from collections.abc import Collection
from typing import Any

from scaraspec.protocol.fields import show


class CaseFailed(AssertionError):  # noqa: N818 - it is the subject's error, not ours
    """The subject violates a requirement.

    Attributes:
        requirement: Which; empty for the first of the case.
        expected: What the document leads to expect.
        observed: What was there instead.
    """

    def __init__(
        self, message: str, *, expected: str = "", observed: str = "", requirement: str = ""
    ) -> None:
        super().__init__(message)
        self.expected, self.observed, self.requirement = expected, observed, requirement


class NoReply(CaseFailed):
    """A request that a living subject left unanswered, or answered by ending the link (3/31).

    Attributes:
        owed: The requirement that every such reply comes; empty if there is none.
    """

    owed = ""


class OperationRefused(CaseFailed):
    """An order that a client refuses by itself, sending nothing of it.

    Values that only the register's silence allows, such as a pose out of reach, a case may order
    `allow_refusal`; the document's own examples, and what is as ordinary, it must not.

    Attributes:
        after_s: How long it took.
    """

    after_s = 0.0


class CaseInconclusive(Exception):  # noqa: N818 - it is not an error
    """The case could not find out; the text says why."""


class Unreadable(CaseInconclusive):
    """The subject reports no valid status: whether it is at rest is unknown.

    Nothing that may move it is tried any more.
    """


class CaseSkipped(CaseInconclusive):
    """The case did not begin; the text says what it would need."""


def expect(
    condition: object,
    message: str,
    *,
    expected: str = "",
    observed: str = "",
    requirement: str = "",
) -> None:
    """Fail the subject unless the condition holds.

    Raises:
        CaseFailed: It does not.
    """
    if not condition:
        raise CaseFailed(message, expected=expected, observed=observed, requirement=requirement)


def expect_equal(observed: Any, expected: Any, message: str, *, requirement: str = "") -> None:
    """Fail the subject unless both are equal.

    Raises:
        CaseFailed: They are not.
    """
    if observed != expected:
        raise CaseFailed(
            message,
            expected=show_value(expected),
            observed=show_value(observed),
            requirement=requirement,
        )


def expect_in(
    observed: Any, options: Collection[Any], message: str, *, requirement: str = ""
) -> None:
    """Fail the subject unless this is one of the options.

    Raises:
        CaseFailed: It is none.
    """
    if observed not in options:
        wanted = " or ".join(map(show_value, options))
        raise CaseFailed(
            message, expected=wanted, observed=show_value(observed), requirement=requirement
        )


def show_value(value: Any) -> str:
    """A value in the words of a report."""
    return show(value) if isinstance(value, bytes) else str(value)
