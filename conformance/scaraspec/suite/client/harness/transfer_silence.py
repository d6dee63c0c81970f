"""Silence during a transfer: how long a client must wait, and when it must abort."""

from collections.abc import Callable
from contextlib import suppress
from typing import Final

from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseSkipped,
    NoReply,
    OperationRefused,
)
from scaraspec.suite.engine.transfer_timeouts import Silence, transfer_timeouts_of
from scaraspec.user_message import UserMessage

_LOOK_S: Final = 0.02
_GRACE_S: Final = 0.5  # until the client reports an aborted transfer


def expect_survives_silence(
    subject: ClientUnderTest,
    call: Call,
    requirement: str,
    go_on: Callable[[], None],
    share: float = 1.0,
) -> None:
    """Keep silent for 25 s, or a share of it, and then continue.

    Args:
        subject: The client.
        call: The transfer.
        requirement: The requirement that an abort violates.
        go_on: Sends the missing frame and requires that the client accepts it.
        share: The share of 25 s. A short silence detects a timeout on the whole transfer.

    Raises:
        CaseFailed: The client has aborted the transfer.
        CaseInconclusive: The silence was longer than intended.
    """
    limits, silence = transfer_timeouts_of(subject), Silence(subject)
    subject.pause(limits.must_survive_s * share)
    silence.end()
    try:
        message = UserMessage(
            "the client aborted a transfer within {survived_s:g} s of silence",
            survived_s=limits.must_survive_s * share,
        )
        subject.expect_pending(call, message)
        go_on()
    except CaseFailed as error:
        silence.require_within(limits.early_s)
        error.requirement = requirement
        raise


def expect_given_up(subject: ClientUnderTest, call: Call, requirement: str) -> None:
    """Keep silent until the client aborts the transfer, after 25 s and within 60 s.

    Raises:
        CaseFailed: It aborts at another time, or reports success.
    """
    limits, silence = transfer_timeouts_of(subject), Silence(subject)
    while call.answer is None and silence.elapsed_s < limits.must_end_s:
        subject.pause(_LOOK_S)
    passed_s = silence.elapsed_s
    try:
        subject.expect_failure(call, within_s=_GRACE_S)
    except CaseFailed as error:
        error.requirement = requirement
        raise
    if passed_s < limits.must_survive_s:
        raise CaseFailed(
            UserMessage(
                "the client aborted a transfer after {passed_s:.2f} s of silence", passed_s=passed_s
            ),
            expected=UserMessage("at least {limit_s} s", limit_s=f"{limits.must_survive_s:.2f}"),
            observed=f"{passed_s:.2f} s",
            requirement=requirement,
        )
    if not limits.early_s <= passed_s <= limits.late_s:
        option = "less" if passed_s < limits.early_s else "more"
        message = UserMessage(
            "the client aborted a transfer after {passed_s:.2f} s of silence", passed_s=passed_s
        )
        subject.tolerate(requirement, "xfer_timeout", option, message)


def expect_given_up_despite_queries(
    subject: ClientUnderTest, line: IncomingConnection, call: Call, requirement: str
) -> None:
    """Require that a silent transfer times out while other queries are answered.

    Raises:
        CaseFailed: It does not.
        CaseSkipped: The client sends no other query while a transfer runs.
    """
    limits, silence = transfer_timeouts_of(subject), Silence(subject)
    name, _ = subject.prefer_unpolled("get_version", "get_status", "get_time")
    asks = True
    while asks and call.answer is None and silence.elapsed_s < limits.must_end_s:
        asks, query = False, subject.begin(name)
        with suppress(NoReply, OperationRefused):
            line.request(name, query, within_s=limits.must_survive_s / 2)
            line.reply(name, data=REPLIES[name])
            asks = True
        subject.pause(limits.must_survive_s / 4)
    if not asks and call.answer is None:
        raise CaseSkipped("the client sends no other query during a transfer")
    try:
        subject.expect_failure(call, within_s=_GRACE_S)
    except CaseFailed as error:
        error.requirement = requirement
        raise
