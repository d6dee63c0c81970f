"""Role adapter: what a run needs to know about its subject, and how its role is tested."""

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

from scaraspec.report.model import Role
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.system_under_test import SystemUnderTest

P = TypeVar("P", bound=SystemUnderTest)


class RoleAdapter(Protocol[P]):
    """The subject of a run, and how a subject of its role is tested."""

    @property
    def role(self) -> Role:
        """The role of the subject."""

    @property
    def ics(self) -> Ics:
        """Its implementation conformance statement."""

    @property
    def options(self) -> Options:
        """The options of the user."""

    @property
    def link(self) -> str:
        """The link to the subject, as the results name it."""

    @property
    def capture(self) -> str:
        """The file name of the recording beside the results; empty if there is none."""

    @property
    def replay(self) -> str:
        """The reproduction command of the run, without ``--only``."""

    @property
    def settings(self) -> Mapping[str, str]:
        """The options, timeouts and time scale of the run by name, for the results."""

    @property
    def needs_login(self) -> bool:
        """Whether a login is needed first; a serial link needs none (L83)."""

    @property
    def real_time(self) -> bool:
        """Whether the subject's clock is not simulated, so that stalls of this machine matter."""

    def subject(self, observer: Observer) -> P:
        """The subject."""

    def begin(self, subject: P) -> Mapping[str, Any]:
        """Read the state that must be restored after the run; `put_back` receives it.

        Raises:
            CaseFailed: The subject cannot be reached.
            CaseInconclusive: The subject cannot be tested.
            JournalError: The state cannot be written to the journal.
        """

    def probe(self, subject: P) -> None:
        """Find out which readings the subject follows at the open points.

        Raises:
            CaseFailed: The subject cannot be reached any more.
            CaseInconclusive: The subject cannot be tested.
        """

    def make_ready(self, subject: P) -> None:
        """Make the subject ready to move."""

    def watch(self, subject: P, for_s: float) -> None:
        """Watch for `for_s` seconds whether another client has caused the failure of a case."""

    def put_back(self, subject: P, state: Mapping[str, Any]) -> list[str]:
        """Restore the state from `begin`; return a sentence for each difference that remains."""

    def finish(self, subject: P, state: Mapping[str, Any]) -> list[str]:
        """End the run after `put_back`; return a sentence for each thing the user must do."""
