"""Expectations: how a case reports a failure of its subject, or that it has no verdict.

Every check names the expected and the observed value. A case that returns has passed. A case that
raises another exception than those of this module is itself defective.
"""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import reduce
from typing import Any, Final, NamedTuple

from scaraspec.judge.verdicts import Reason
from scaraspec.protocol.fields import show
from scaraspec.report.failed_step import Stage
from scaraspec.suite.engine.hooks import missing_hooks_message
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.user_message import UserMessage


class Moment(NamedTuple):
    """What had been seen at one instant of a case.

    Attributes:
        time_ns: The time of the last byte, in nanoseconds since the Unix epoch.
        frames: The last frames, in order.
    """

    time_ns: int = 0
    frames: tuple[FrameSeen | InvalidBytes, ...] = ()


_MOMENT: Final[ContextVar[Callable[[], Moment]]] = ContextVar("moment", default=Moment)


@contextmanager
def observed_by(moment: Callable[[], Moment]) -> Iterator[None]:
    """Let failures note the moment at which they occur while the context is active.

    After a failure a case sends more frames, to restore its changes.
    """
    token = _MOMENT.set(moment)
    try:
        yield
    finally:
        _MOMENT.reset(token)


class CaseFailed(AssertionError):  # noqa: N818 - it is the subject's error, not ours
    """The subject violates a requirement.

    Attributes:
        requirement: The violated requirement; empty for the first requirement of the case.
        expected: What the document requires.
        observed: What was observed instead.
        depends_on: The earlier case that has shown this failure, if the wait budget is used up; the
            case is then inconclusive.
        moment: What had been seen when it was raised.
        due: The command and the stage that were due; None for those of the last frame.
        preparation: Whether the step that failed prepared the case, and did not belong to it.
    """

    due: tuple[str, Stage] | None = None
    preparation = False
    depends_on = ""

    def __init__(
        self, message: str, *, expected: str = "", observed: str = "", requirement: str = ""
    ) -> None:
        super().__init__(message)
        self.expected, self.observed, self.requirement = expected, observed, requirement
        self.moment = _MOMENT.get()()


class NoReply(CaseFailed):
    """A request was not answered, or the subject closed the connection instead (3/31).

    Attributes:
        reply_requirement: The requirement that such a reply is sent; empty if there is none.
    """

    reply_requirement = ""


class NotConnected(NoReply):
    """The subject accepts no connection, or has ended it."""

    due = ("", Stage.CONNECTION)


@contextmanager
def preparation() -> Iterator[None]:
    """Mark failures as those of the preparation of a case; also usable as a decorator."""
    try:
        yield
    except CaseFailed as error:
        error.preparation = True
        raise


class OperationRefused(CaseFailed):
    """A client refused an operation before it sent a request.

    A case uses `allow_refusal` for values that a client may refuse, such as a pose out of reach.
    A client must not refuse the examples of the document and other ordinary values.

    Attributes:
        after_s: The time from the operation to the refusal, in seconds.
    """

    after_s = 0.0


class CaseInconclusive(Exception):  # noqa: N818 - it is not an error
    """The case has no verdict; the message states the reason.

    Attributes:
        reason: Why, as a code for programs.
    """

    reason = Reason.UNDECIDED


class SentTooSlowly(CaseInconclusive):
    """The suite sent so slowly that the result proves nothing. The case is tried again."""

    reason = Reason.STALLED


class RequestAbandoned(SentTooSlowly):
    """The suite has not sent the last part of a request, because a pause before was too long."""


class Unreadable(CaseInconclusive):
    """The subject reports no valid status, so it is unknown whether it is at rest.

    The suite starts no further motion.
    """


class CaseSkipped(CaseInconclusive):
    """The case did not run; the message states what it needs."""

    reason = Reason.NOT_APPLICABLE


class EndedTooSoon(CaseSkipped):
    """A command ended before the case could use it. The case is tried again."""

    reason = Reason.TOO_SHORT


class HookMissing(CaseSkipped):
    """The ICS does not define the hooks that the case needs.

    Args:
        hooks: Their names.
        message: Replaces the usual message.
    """

    reason = Reason.HOOK

    def __init__(self, *hooks: str, message: str = "") -> None:
        super().__init__(message or missing_hooks_message(hooks))
        self.hooks = hooks


def expect(
    condition: object,
    message: str,
    *,
    expected: str = "",
    observed: str = "",
    requirement: str = "",
) -> None:
    """Require a condition.

    Raises:
        CaseFailed: The condition is false.
    """
    if not condition:
        raise CaseFailed(message, expected=expected, observed=observed, requirement=requirement)


def expect_equal(observed: Any, expected: Any, message: str, *, requirement: str = "") -> None:
    """Require that two values are equal.

    Raises:
        CaseFailed: They differ.
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
    """Require that a value is one of the options.

    Raises:
        CaseFailed: It is not.
    """
    if observed not in options:
        expected = reduce(_either, map(show_value, options), "")
        raise CaseFailed(
            message, expected=expected, observed=show_value(observed), requirement=requirement
        )


def _either(first: str, second: str) -> str:
    return UserMessage("{first} or {second}", first=first, second=second) if first else second


def show_value(value: Any) -> str:
    """Return a value as reports show it."""
    return show(value) if isinstance(value, bytes) else str(value)
