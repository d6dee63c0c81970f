"""Setting: what a run against a client is about, and how it begins and ends."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scaraspec.report.model import Role
from scaraspec.suite.client.harness.access import Access
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import Options

_MADE_UP = "levitate"


@dataclass(frozen=True)
class ClientAdapter:
    """A run against a client; see `run.Setting`.

    Attributes:
        access: The way to the subject.
        ics: What it claims.
        options: What the tester asks for.
        link: How to call the way to it, in the results.
        capture: The file in which it is recorded, beside the results; empty for none.
        replay: The command line that runs the suite again, without ``--only``.
    """

    access: Access
    ics: Ics
    options: Options
    link: str = ""
    capture: str = ""
    replay: str = ""
    role = Role.CLIENT
    needs_login = True

    def subject(self, observer: Observer) -> ClientUnderTest:
        """The client under test."""
        return ClientUnderTest(self.access, self.ics, observer)

    def begin(self, subject: ClientUnderTest) -> Mapping[str, Any]:
        """See whether it is there, and says of an operation that nobody has that it lacks it.

        Raises:
            CaseFailed: It is not there.
        """
        subject.settle()
        return {"honest": self.access.attended or subject.lacks_operation(_MADE_UP)}

    def probe(self, subject: ClientUnderTest) -> None:
        """Nothing: what a client takes shows by itself."""

    def make_ready(self, subject: ClientUnderTest) -> None:
        """Nothing: a client moves nothing."""

    def watch(self, subject: ClientUnderTest, for_s: float) -> None:
        """Nothing: a client has no clients."""

    def put_back(self, subject: ClientUnderTest, state: Mapping[str, Any]) -> list[str]:
        """Tell what makes its driver doubtful."""
        problems = []
        if state and not state["honest"]:
            problems.append(
                f"the driver does not say of {_MADE_UP}, which nobody has, that it lacks it"
            )
        if subject.access.unmatched_lines:
            problems.append(
                f"the driver says what answers no order: {subject.access.unmatched_lines[0]}"
            )
        return problems

    def finish(self, subject: ClientUnderTest, state: Mapping[str, Any]) -> list[str]:
        """Nothing: a run against a client leaves nothing behind."""
        del subject, state
        return []
