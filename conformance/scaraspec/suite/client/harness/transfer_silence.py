"""Silences: which a client's transfer has to survive, and which have to end it."""

from collections.abc import Callable
from contextlib import suppress
from typing import Final

from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    OperationRefused,
)
from scaraspec.suite.engine.transfer_timeouts import Silence, limits_of
from scaraspec.user_message import UserMessage

_LOOK_S: Final = 0.02
_GRACE_S: Final = 0.5  # until a client that has given up says so


def expect_survives_silence(
    subject: ClientUnderTest,
    call: Call,
    requirement: str,
    go_on: Callable[[], None],
    share: float = 1.0,
) -> None:
    """Keep silent for 25 s, or a share of them, and then go on.

    Args:
        subject: The client.
        call: The transfer.
        requirement: What it violates that has given up.
        go_on: Sends what has been missed so long, and sees that the client takes it.
        share: How much of that silence; a short one shows a limit on a transfer as a whole.

    Raises:
        CaseFailed: The client has given up.
        CaseInconclusive: The silence was longer than it should be.
    """
    limits, silence = limits_of(subject), Silence(subject)
    subject.pause(limits.survived_s * share)
    passed_s = silence.passed_s
    try:
        message = UserMessage(
            "a transfer did not survive {survived_s:g} s of silence",
            survived_s=limits.survived_s * share,
        )
        subject.expect_pending(call, message)
        go_on()
    except CaseFailed as error:
        if passed_s > limits.early_s:
            raise CaseInconclusive(
                UserMessage(
                    "this machine is too slow: it was silent for {passed_s:g} s", passed_s=passed_s
                )
            ) from None
        error.requirement = requirement
        raise


def expect_given_up(subject: ClientUnderTest, call: Call, requirement: str) -> None:
    """Keep silent until the client gives up, which it has to do after 25 s and within 60 s.

    Raises:
        CaseFailed: It does so at another time, or says that the transfer was done.
    """
    limits, silence = limits_of(subject), Silence(subject)
    while call.answer is None and silence.passed_s < limits.over_s:
        subject.pause(_LOOK_S)
    passed_s = silence.passed_s
    try:
        subject.expect_failure(call, within_s=_GRACE_S)
    except CaseFailed as error:
        error.requirement = requirement
        raise
    if passed_s < limits.survived_s:
        raise CaseFailed(
            UserMessage(
                "a transfer was given up after {passed_s:.2f} s of silence", passed_s=passed_s
            ),
            expected=f"at least {limits.survived_s:.2f} s",
            observed=f"{passed_s:.2f} s",
            requirement=requirement,
        )
    if not limits.early_s <= passed_s <= limits.late_s:
        option = "less" if passed_s < limits.early_s else "more"
        message = UserMessage(
            "a transfer was given up after {passed_s:.2f} s of silence", passed_s=passed_s
        )
        subject.tolerate(requirement, "xfer_timeout", option, message)


def expect_given_up_despite_queries(
    subject: ClientUnderTest, line: IncomingConnection, call: Call, requirement: str
) -> None:
    """Let the client ask for other things until it gives a silent transfer up, in the same time.

    Raises:
        CaseFailed: It does not.
        CaseSkipped: It asks for nothing else as long as a transfer lasts.
    """
    limits, silence = limits_of(subject), Silence(subject)
    name, _ = subject.prefer_unpolled("get_version", "get_status", "get_time")
    asks = True
    while asks and call.answer is None and silence.passed_s < limits.over_s:
        asks, query = False, subject.begin(name)
        with suppress(NoReply, OperationRefused):
            line.request(name, query, within_s=limits.survived_s / 2)
            line.reply(name, data=REPLIES[name])
            asks = True
        subject.pause(limits.survived_s / 4)
    if not asks and call.answer is None:
        raise CaseSkipped("the client asks for nothing else while a transfer lasts")
    try:
        subject.expect_failure(call, within_s=_GRACE_S)
    except CaseFailed as error:
        error.requirement = requirement
        raise
