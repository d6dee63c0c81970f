"""What follows from the claims of the ICS that commands are unsupported (`lacks`)."""

from collections.abc import Iterator

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.system_under_test import SystemUnderTest
from scaraspec.user_message import UserMessage


def wrong_claims(subject: SystemUnderTest) -> Iterator[Outcome]:
    """Yield a failure for each command that is served although the ICS says that it is not."""
    for name, served in sorted(subject.served.items()):
        if served:
            yield Outcome(
                Case(f"claim.lacks.{name}", (), frozenset({Hazard.READ_ONLY})),
                Verdict.FAIL,
                cause=Cause.SUBJECT,
                message=UserMessage(
                    "the ICS claims that {command} is unsupported, but it is answered", command=name
                ),
                expected="no reply, or the reply to an undefined opcode (A-3-9)",
                observed="a reply with its opcode",
            )


def unverified_notices(subject: SystemUnderTest) -> Iterator[str]:
    """Yield a sentence for each claim that could not be tested."""
    for name in sorted(subject.ics.unsupported - subject.served.keys()):
        hazard = BY_NAME[name].hazard
        yield UserMessage(
            "Not verified: the ICS claims that {command} is unsupported. --allow {hazard} tests it",
            command=name,
            hazard=hazard.value,
        )


def excluded_requirements(subject: SystemUnderTest) -> frozenset[str]:
    """Return the requirements of commands that are unsupported, as far as this was verified."""
    clauses = {BY_NAME[name].clause for name, served in subject.served.items() if not served}
    return frozenset(each.id for each in REQUIREMENTS.values() if each.clause in clauses)
