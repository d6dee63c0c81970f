"""Clause 3: which reply belongs to which request, and whether every request is answered."""

from typing import Final

from scaraspec.judge.rules.clause_3 import untagged_result
from scaraspec.judge.rules.ports import OUTPUTS
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    rule,
    tolerated,
)
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.errors import BUSY
from scaraspec.traffic.events import Ending, Exchange, UnsolicitedReply
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_MAX_AGE_NS: Final = 1_000_000_000
"""Maximum age of a status that shows the state."""


@rule("3/11", on=Exchange, sender=A2C, by_bytes=True)
def reply_has_its_opcode(x: Exchange, _: RobotState) -> RuleResult | None:
    """The first reply carries the request's opcode (A-3-14).

    If the reply arrives later, a frame with another opcode is only unsolicited (A-3-16).
    """
    if x.reply:
        return PASSED
    given_up = x.ending is Ending.UNANSWERED or x.overtaken or x.mismatched
    if not x.unmatched_reply or not given_up or not _reply_expected(x):
        return None
    return failed(
        UserMessage("{command} was answered with another opcode", command=x.name),
        expected=f"{x.request.frame.opcode:02X}",
        observed=f"{x.unmatched_reply.frame.opcode:02X}",
        at=(x.request.place, x.unmatched_reply.place),
    )


@rule("3/26", on=Exchange, sender=A2C, by_bytes=True)
def reply_is_solicited(x: Exchange, _: RobotState) -> RuleResult | None:
    """A reply to a request is solicited."""
    return PASSED if x.reply else None


@rule("3/26", on=UnsolicitedReply, sender=C2A)
def nothing_unsolicited(unsolicited: UnsolicitedReply, robot: RobotState) -> RuleResult | None:
    """Only replies, final results, list parts and chunks come from the controller (A-3-16)."""
    frame = unsolicited.seen.frame
    if frame.tagged or unsolicited.late or untagged_result(unsolicited, robot):
        return None
    if not unsolicited.certain:
        return inconclusive("the request may be in a gap of the recording")
    return tolerated(
        "A-3-16",
        "unsolicited frame",
        UserMessage(
            "the controller sent an unsolicited frame with opcode {opcode:02X}", opcode=frame.opcode
        ),
    )


@rule("3/24", on=Exchange, sender=A2C, by_bytes=True)
def replies_in_order(x: Exchange, _: RobotState) -> RuleResult | None:
    """First replies come in request order (A-3-14)."""
    if not x.reply or x.overdue:
        return None
    if not x.overtaken:
        return PASSED
    return tolerated(
        "pipelining",
        "any-order",
        UserMessage(
            "the reply to a later request came before the reply to {command}", command=x.name
        ),
    )


@rule("3/25", on=Exchange, sender=A2C, by_bytes=True)
def one_open_request(x: Exchange, _: RobotState) -> RuleResult | None:
    """The client has at most one unanswered request per opcode (A-3-14)."""
    if not x.same_opcode_pending:
        return PASSED
    return tolerated(
        "A-3-14",
        "two open requests",
        UserMessage("{command} was requested again before its reply", command=x.name),
    )


def _reply_expected(x: Exchange) -> bool:
    """Return whether a reply is expected: the request is valid, after a login, and in order."""
    valid = x.request.parsed is not None and not x.request.parsed.decoded.issues
    served = x.logged_in or x.name == "login"
    out_of_place = x.name == "upload_chunk" and (x.transfer is None or x.after_silence)  # A-5-16
    error_signal = x.chunk is not None and x.chunk.length == 0
    return valid and bool(served) and not out_of_place and not error_signal


@rule("3/31", on=Exchange, sender=A2C)
def answered(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Every valid request is answered within the reply time (A-3-15)."""
    if x.command is None or not _reply_expected(x):
        return None
    if x.reply and x.requested_again:
        return inconclusive(
            UserMessage(
                "{command} was answered after {latency_s:.1f} s, when it had been requested again:"
                " either this reply was late, or the first request was not answered at all",
                command=x.name,
                latency_s=(x.latency_ns or 0) / 1e9,
            )
        )
    if x.malformed or (x.reply and not x.overdue):
        return PASSED
    if x.reply:
        if x.concurrent or x.concurrent_uncertain:
            return tolerated(
                "A-4-3",
                "not served",
                UserMessage("{command} waited for the busy robot", command=x.name),
            )
        return failed(
            UserMessage(
                "{command} was answered late: after the reply time and after a later request",
                command=x.name,
            ),
            expected="a reply in time",
            observed=UserMessage(
                "a reply after {time_s} s", time_s=f"{(x.latency_ns or 0) / 1e9:.1f}"
            ),
        )
    if x.ending is Ending.UNSEEN:
        if x.ambiguous:
            return None  # the late reply to the request before it was judged
        return inconclusive(
            UserMessage("the answer to {command} may be in a gap of the recording", command=x.name)
        )
    if x.ending is not Ending.UNANSWERED or x.unmatched_reply:
        return None
    if x.request.pause_ns > robot.longest_pause_ns:
        return inconclusive(
            UserMessage(
                "{command} was not answered: it was sent with a pause of {pause_s:.1f} s inside, "
                "after which the controller may have dropped it (A-3-11)",
                command=x.name,
                pause_s=x.request.pause_ns / 1e9,
            )
        )
    return _judge_silence(x, robot) or failed(
        UserMessage("{command} was not answered, although a later request was", command=x.name),
        expected="a reply",
        observed="none",
        at=(x.request.place, *((x.overtaken_by.place,) if x.overtaken_by else ())),
    )


@rule("3/33", on=Exchange, sender=A2C, by_bytes=True)
def late_reply_is_not_the_next(x: Exchange, _: RobotState) -> RuleResult | None:
    """A late reply is not taken for the reply to the next request with its opcode (A-3-14).

    A capture does not show for which request the client took it.
    """
    if not x.requested_again or not x.reply:
        return None
    result = inconclusive(
        UserMessage(
            "{command} was requested again before a late reply came: the client may have taken the"
            " reply to the first request for the reply to the second, which is a violation, or"
            " have discarded it",
            command=x.name,
        )
    )
    return result._replace(places=(*places_of(x), x.requested_again.place))


def _judge_silence(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Return the toleration of a missing reply; inconclusive if the link may be dead."""
    if not x.certain:
        return inconclusive(
            UserMessage("the answer to {command} may be in a gap of the recording", command=x.name)
        )
    if x.concurrent or _may_be_busy(x, robot):
        two_stage = x.command is not None and x.command.two_stage
        reading = ("busy_reply", "silence") if two_stage else ("A-4-3", "not served")
        return tolerated(
            *reading, UserMessage("{command} was not answered by the busy robot", command=x.name)
        )
    if x.name == "get_default_program":
        opcode, other = x.request.frame.opcode, robot.last.get(x.name)
        if other and other.request.frame.opcode != opcode:
            option = f"0x{other.request.frame.opcode:02X}"
            message = UserMessage("0x{opcode:02X} was not answered", opcode=opcode)
            return tolerated("op_get_default", option, message)
        return tolerated(
            "default_none", "silence", UserMessage("{command} was not answered", command=x.name)
        )
    if x.name == "jog" and not _is_in_its_notation(x, robot):
        option = "binary" if _is_text(x) else "ascii"
        reason = "the jog was not answered; the controller may expect the other notation"
        return tolerated("jog_byte", option, reason)
    if x.name == "set_digital_output" and x.request.value.port > OUTPUTS:
        return tolerated("A-3-9", "ignored", "the request to set a port above 16 was not answered")
    if not x.overtaken:
        return inconclusive(
            UserMessage(
                "{command} and later requests were not answered; the connection may be lost",
                command=x.name,
            )
        )
    if x.pipelined:
        return tolerated(
            "pipelining",
            "one",
            UserMessage(
                "{command} was not answered; it was sent while another request was pending",
                command=x.name,
            ),
        )
    return None


def _is_text(jog: Exchange) -> bool:
    return jog.request.frame.data >= b"0"


def _is_in_its_notation(jog: Exchange, robot: RobotState) -> bool:
    """Whether the last answered jog used the same notation (A-4.28-1)."""
    last = robot.last.get(jog.name)
    return last is not None and _is_text(last) == _is_text(jog)


def _may_be_busy(x: Exchange, robot: RobotState) -> bool:
    """Whether the robot may have been executing although no frame before `x` shows it.

    The first reply "1" of an earlier request may have been on its way. The end of the last accepted
    command may be missing, because its client disconnected. The status may show a program that no
    recorded client started: another signal may start one (A-4.12-3).
    """
    statuses = robot.history.between("get_status", x.time_ns, x.time_ns + _MAX_AGE_NS)
    for y in (robot.history.last("get_status", before_ns=x.time_ns), *statuses):
        if y and y.reply_value in BUSY and not y.concurrent:
            return True
    accepted = reversed(robot.history.accepted)
    last = next((y for y in accepted if y.time_ns < x.time_ns), None)
    if last and answered_ns(last) > x.time_ns:
        return True
    if last is None or last.result:
        return False
    return not answered_ns(last) < robot.history.idle_seen_ns < x.time_ns
