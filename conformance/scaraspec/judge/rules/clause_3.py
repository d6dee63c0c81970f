"""Clause 3: frames, tags, and final results. The module `replies` judges first replies."""

from scaraspec.judge.requirements import SUCCESS
from scaraspec.judge.rules.diagnosis import Fault, diagnose
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    rule,
    tolerated,
)
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_OPCODE, UNDOCUMENTED_GAP
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import MAX_DATA_BYTES, TAG
from scaraspec.protocol.payloads import FinalResult
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, InvalidBytes, UnsolicitedReply
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

# Frames and invalid bytes


@rule("3/1", "3/6", "3/7", "3/32", on=FrameSeen)
def whole_frame(_seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A valid frame has the correct layout and length, and no stray bytes before it (L89-98)."""
    return PASSED


@rule("3/8", on=FrameSeen)
def empty_frame(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """With length 0x00 the end byte follows (L98)."""
    return None if seen.frame.data else PASSED


@rule("3/2", "3/3", "3/28", on=FrameSeen, sender=A2C)
def client_frame(_seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A valid client frame has AA and CC (L92), and a length of one byte (L89)."""
    return PASSED


@rule("3/4", "3/5", on=FrameSeen, sender=C2A)
def controller_frame(_seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A valid controller frame has CC and AA (L94)."""
    return PASSED


def _fail_if(invalid: InvalidBytes, fault: Fault, what: str) -> RuleResult | None:
    diagnosis = diagnose(invalid)
    if diagnosis.fault is not fault:
        return None
    if diagnosis.hint:
        what = UserMessage("{problem} ({hint})", problem=what, hint=diagnosis.hint)
    return failed(what, expected=diagnosis.expected, observed=diagnosis.observed)


@rule("3/1", on=InvalidBytes)
def layout(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """Bytes that begin like a frame but are not a valid frame (L89-90)."""
    return _fail_if(
        invalid, Fault.UNCLEAR, "the bytes start like a frame but are not a valid frame"
    )


@rule("3/2", on=InvalidBytes, sender=A2C)
def client_start(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """Client frames start with AA (L92)."""
    return _fail_if(invalid, Fault.START, "a client frame starts with a wrong byte")


@rule("3/3", on=InvalidBytes, sender=A2C)
def client_end(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """Client frames end with CC (L92)."""
    return _fail_if(invalid, Fault.END, "a client frame ends with a wrong byte")


@rule("3/4", on=InvalidBytes, sender=C2A)
def controller_start(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """Controller frames start with CC (L94)."""
    return _fail_if(invalid, Fault.START, "a controller frame starts with a wrong byte")


@rule("3/5", on=InvalidBytes, sender=C2A)
def controller_end(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """Controller frames end with AA (L94)."""
    return _fail_if(invalid, Fault.END, "a controller frame ends with a wrong byte")


@rule("3/6", "3/7", on=InvalidBytes)
def length(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """The length is one byte, the number of data bytes that follow (L89, L98)."""
    return _fail_if(invalid, Fault.LENGTH, "the length is not the number of data bytes")


@rule("3/8", on=InvalidBytes)
def no_data_after_zero(invalid: InvalidBytes, robot: RobotState) -> RuleResult | None:
    """With length 0x00 no data byte is present (L98)."""
    return length(invalid, robot) if diagnose(invalid).observed == "0" else None


@rule("3/28", on=InvalidBytes, sender=A2C)
def one_byte_length(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """A sender does not attempt more than 255 data bytes in one frame (L89)."""
    diagnosis = diagnose(invalid)
    if diagnosis.fault is not Fault.LENGTH or diagnosis.surplus_bytes % 256:
        return None
    return failed(
        UserMessage(
            "{byte_count} data bytes were sent in one frame", byte_count=diagnosis.expected
        ),
        expected=UserMessage("at most {limit}", limit=MAX_DATA_BYTES),
        observed=diagnosis.expected,
    )


@rule("3/32", on=InvalidBytes)
def nothing_between(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """A sender sends nothing between frames."""
    return _fail_if(invalid, Fault.STRAY, "there are bytes between frames that belong to no frame")


@rule("3/10", on=FrameSeen)
def defined_opcode(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Each frame uses an opcode of clauses 4 and 5 for its direction (L96)."""
    opcode = seen.frame.opcode
    if opcode in BY_OPCODE:
        return PASSED
    if seen.frame.direction is A2C and opcode == TAG:
        return None  # 3/15 judges it
    gap = ", in a range whose clauses the document omits" if opcode in UNDOCUMENTED_GAP else ""
    return failed(
        "the opcode is not defined", expected="a defined opcode", observed=f"{opcode:02X}{gap}"
    )


# The tag of final results


@rule("3/12", on=FrameSeen, sender=C2A)
def tagged_layout(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A final result is CC 90 opcode length data AA (L320-321)."""
    return PASSED if seen.frame.tagged else None


@rule("3/12", on=UnsolicitedReply, sender=C2A)
def untagged_result(unsolicited: UnsolicitedReply, _: RobotState) -> RuleResult | None:
    """A final result without its tag (L320-321)."""
    seen, after = unsolicited.seen, unsolicited.after
    if seen.frame.tagged or not after or not after.command or not after.command.two_stage:
        return None
    looks_like_one = FinalResult().decode(seen.frame.data).value is not None
    if not after.accepted or after.result or not looks_like_one:
        return None
    return failed(
        UserMessage("the final result of {command} came without the tag 90", command=after.name),
        expected=f"90 {seen.frame.opcode:02X}",
        observed=f"{seen.frame.opcode:02X}",
        at=(*(f.place for f in after.frames), seen.place),
    )


@rule("3/14", on=FrameSeen, sender=C2A)
def tag_only_on_two_stage(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Only the eight two-stage commands use the tag; on another opcode it is tolerated (A-3-6)."""
    if not seen.frame.tagged:
        return None
    if seen.command:
        return PASSED
    opcode = f"{seen.frame.opcode:02X}"
    return tolerated(
        "A-3-6",
        f"90 {opcode}",
        UserMessage("the tag 90 precedes the opcode {opcode}", opcode=opcode),
    )


@rule("3/15", on=FrameSeen, sender=A2C)
def client_never_tags(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Only the controller sends the tag."""
    if seen.frame.opcode != TAG:
        return PASSED
    return failed("a client frame contains the tag 90", expected="no tag", observed="90")


@rule("3/15", on=InvalidBytes, sender=A2C)
def client_tagged(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """A client frame that is valid except for its tag."""
    return _fail_if(invalid, Fault.TAG, "a client frame contains the tag 90")


# Final results


@rule("3/16", on=Exchange, sender=A2C, by_bytes=True)
def result_after_reply(x: Exchange, _: RobotState) -> RuleResult | None:
    """The final result follows the first reply "1" (L318)."""
    return PASSED if x.result else None


def _misplaced(unsolicited: UnsolicitedReply, robot: RobotState) -> bool:
    """Whether neither a delay nor another connection explains this final result."""
    seen = unsolicited.seen
    known = seen.frame.tagged and seen.command is not None
    return known and not unsolicited.late and not _requested_elsewhere(unsolicited, robot)


def _requested_elsewhere(unsolicited: UnsolicitedReply, robot: RobotState) -> bool:
    """Whether this may belong to a request of another connection, also if its reply is on the way.

    A command that has ended, or was refused, has no further result.
    """
    seen = unsolicited.seen
    request, last = robot.history.last_requests.get(seen.name), robot.last.get(seen.name)
    if unsolicited.elsewhere or request is None:
        return unsolicited.elsewhere
    has_ended = seen.frame.tagged and last is not None and last.request is request
    return request.place.connection != seen.place.connection and not has_ended


@rule("3/16", on=UnsolicitedReply, sender=C2A)
def result_without_request(unsolicited: UnsolicitedReply, robot: RobotState) -> RuleResult | None:
    """A final result without an accepted request before it."""
    if _requested_elsewhere(unsolicited, robot) and not unsolicited.late:
        template = (
            "a final result of {command} came on a connection that did not request it"
            if unsolicited.seen.frame.tagged
            else "a reply to {command} came on a connection that did not request it"
        )
        message = UserMessage(template, command=unsolicited.seen.name)
        return tolerated("A-2-9", "elsewhere", message)
    if not _misplaced(unsolicited, robot):
        return None
    name = unsolicited.seen.name
    waiting = next((x for x in unsolicited.waiting if x.name == name), None)
    if waiting:
        return failed(
            UserMessage("the final result of {command} came before its first reply", command=name),
            expected="the first reply first",
            observed="the final result first",
            at=(waiting.request.place, unsolicited.seen.place),
        )
    if unsolicited.after:
        return None  # 3/17 or 3/18 judges it
    return failed(
        UserMessage(
            "the controller sent a final result of {command} without a request", command=name
        ),
        expected="no final result",
        observed=show(unsolicited.seen.frame.data),
    )


@rule("3/17", on=Exchange, sender=A2C, by_bytes=True)
def no_result_after_refusal(x: Exchange, _: RobotState) -> RuleResult | None:
    """A refusal ends the command; a later result is an `UnsolicitedReply`."""
    two_stage = x.command is not None and x.command.two_stage
    return PASSED if two_stage and x.accepted is False else None


@rule("3/17", on=UnsolicitedReply, sender=C2A)
def result_after_refusal(unsolicited: UnsolicitedReply, robot: RobotState) -> RuleResult | None:
    """After a first reply beginning with "0" no final result is sent."""
    after = unsolicited.after
    if not _misplaced(unsolicited, robot) or not after or after.accepted is not False:
        return None
    return failed(
        UserMessage(
            "the controller sent a final result although {command} was refused",
            command=after.name,
        ),
        expected="no final result",
        observed=show(unsolicited.seen.frame.data),
        at=(*(seen.place for seen in after.frames), unsolicited.seen.place),
    )


@rule("3/18", on=Exchange, sender=A2C, by_bytes=True)
def one_result(x: Exchange, _: RobotState) -> RuleResult | None:
    """Each accepted two-stage command has exactly one final result (L318)."""
    if not x.command or not x.command.two_stage or not x.accepted:
        return None
    if x.result:
        return PASSED
    if x.ending is Ending.UNSEEN:
        return inconclusive(
            UserMessage(
                "the final result of {command} may be in a gap of the recording", command=x.name
            )
        )
    if x.ending is not Ending.UNFINISHED:
        return None
    if x.interrupted_by and x.interrupted_by.name == "jog":
        return tolerated(
            "A-4.28-5", "replace", "a jog had no final result before the next jog replaced it"
        )
    if x.interrupted_by:
        return tolerated(
            "estop_interrupted",
            "none",
            UserMessage("the stopped {command} had no final result of its own", command=x.name),
        )
    return failed(
        UserMessage(
            "{command} was accepted, but the robot became idle without sending a final result",
            command=x.name,
        ),
        expected="one final result",
        observed="none",
        at=(*(f.place for f in x.frames), *((x.idle_status.place,) if x.idle_status else ())),
    )


@rule("3/18", on=UnsolicitedReply, sender=C2A)
def second_result(unsolicited: UnsolicitedReply, robot: RobotState) -> RuleResult | None:
    """A second final result of the same command."""
    after = unsolicited.after
    if not _misplaced(unsolicited, robot) or not after or not after.result:
        return None
    return failed(
        UserMessage("the controller sent a second final result of {command}", command=after.name),
        expected="one final result",
        observed="a second one",
        at=(*(seen.place for seen in after.frames), unsolicited.seen.place),
    )


def _no_result(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A successful command sends its final result (L318 and similar)."""
    result = one_result(x, robot)
    return result if result and result.verdict is Verdict.FAIL else None


for _name, _requirement in SUCCESS.items():
    if _name != "release_joints":  # no status shows that it has ended (A-4-5)
        rule(_requirement, on=Exchange, names=(_name,))(_no_result)
    rule(_requirement, on=UnsolicitedReply, names=(_name,), sender=C2A)(untagged_result)
