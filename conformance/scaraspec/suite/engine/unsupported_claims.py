"""What follows from the claims of the ICS that commands are unsupported (`lacks`)."""

from collections.abc import Iterator, Mapping

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.report.fingerprint import fingerprint
from scaraspec.report.model import Case
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage


def wrong_claims(served_commands: Mapping[str, bool], replay: str) -> Iterator[Case]:
    """Yield a failure for each command that is served although the ICS says that it is not.

    Args:
        served_commands: Whether each command is served; see `SystemUnderTest.served`.
        replay: The reproduction command.
    """
    for name, served in sorted(served_commands.items()):
        if served:
            case_id = f"claim.lacks.{name}"
            message = UserMessage(
                "the ICS claims that {command} is unsupported, but it is answered", command=name
            )
            yield Case(
                case_id,
                (),
                Verdict.FAIL,
                cause=Cause.SUBJECT,
                message=message,
                expected="no reply, or the reply to an undefined opcode (A-3-9)",
                observed="a reply with its opcode",
                replay=replay,
                fingerprint=fingerprint(case_id, "", message),
            )


def answers(reply: Frame, dialect: Dialect) -> bool:
    """Return whether a frame serves a command, unlike the reply to an undefined opcode (A-3-9)."""
    return reply.tagged or not (dialect["on_unknown"] == "0" and reply.data == b"0")


def unverified_notices(subject: SystemUnderTest) -> Iterator[str]:
    """Yield a sentence for each claim that could not be tested."""
    for name in sorted(subject.ics.unsupported - subject.served.keys()):
        hazard = BY_NAME[name].hazard
        yield UserMessage(
            "Not verified: the ICS claims that {command} is unsupported. --allow {hazard} tests it",
            command=name,
            hazard=hazard.value,
        )


def excluded_requirements(served_commands: Mapping[str, bool]) -> frozenset[str]:
    """Return the requirements of commands that are unsupported, as far as this was verified."""
    clauses = {BY_NAME[name].clause for name, served in served_commands.items() if not served}
    return frozenset(each.id for each in REQUIREMENTS.values() if each.clause in clauses)
