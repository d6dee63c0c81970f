"""Adapter for the role of the client: how a run begins, checks the driver and ends."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scaraspec.report.model import Role
from scaraspec.suite.client.harness.access import Access
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import Options
from scaraspec.user_message import UserMessage

_UNKNOWN_OPERATION = "levitate"


@dataclass(frozen=True)
class ClientAdapter:
    """A run against a client; see `role_adapter.RoleAdapter`.

    Attributes:
        access: The access to the client.
        ics: The implementation conformance statement of the client.
        options: The options of the run.
        link: The name of the link in the results.
        capture: The file with the recorded traffic, in the folder of the results; empty for none.
        replay: The reproduction command of the run, without ``--only``.
    """

    access: Access
    ics: Ics
    options: Options
    link: str = ""
    capture: str = ""
    replay: str = ""
    role = Role.CLIENT
    needs_login = True

    @property
    def settings(self) -> Mapping[str, str]:
        """The options, timeouts and time scale of the run by name, for the results."""
        own = {"answer_timeout_s": f"{self.access.answer_timeout_s:g}"}
        return {**self.options.summary, **self.ics.timing_summary, **own}

    @property
    def real_time(self) -> bool:
        """Whether the subject's clock is not simulated."""
        return self.access.real_time

    def subject(self, observer: Observer) -> ClientUnderTest:
        """The client under test."""
        return ClientUnderTest(self.access, self.ics, observer)

    def begin(self, subject: ClientUnderTest) -> Mapping[str, Any]:
        """Check that the client responds, and that its driver reports an unknown operation.

        Returns:
            Whether the driver answers an unknown operation with "unimplemented".

        Raises:
            CaseFailed: The client does not respond.
        """
        subject.settle()
        return {
            "reports_unimplemented": self.access.attended
            or subject.lacks_operation(_UNKNOWN_OPERATION)
        }

    def probe(self, subject: ClientUnderTest) -> None:
        """Do nothing: the cases find out what a client accepts."""

    def make_ready(self, subject: ClientUnderTest) -> None:
        """Do nothing: a client moves no robot."""

    def watch(self, subject: ClientUnderTest, for_s: float) -> None:
        """Do nothing: a client has no other clients."""

    def put_back(self, subject: ClientUnderTest, state: Mapping[str, Any]) -> list[str]:
        """Return the problems that make the driver unreliable."""
        problems: list[str] = []
        if state and not state["reports_unimplemented"]:
            problems.append(
                UserMessage(
                    'the driver does not answer "unimplemented" for the unknown operation'
                    " {operation}",
                    operation=_UNKNOWN_OPERATION,
                )
            )
        if subject.access.unmatched_lines:
            problems.append(
                UserMessage(
                    "the driver writes a line that answers no operation: {line}",
                    line=subject.access.unmatched_lines[0],
                )
            )
        return problems

    def finish(self, subject: ClientUnderTest, state: Mapping[str, Any]) -> list[str]:
        """Do nothing: a run against a client leaves nothing to clean up."""
        del subject, state
        return []
