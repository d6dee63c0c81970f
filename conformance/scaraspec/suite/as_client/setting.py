"""Setting: what a run against a controller is about, and how it begins and ends."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scaraspec.report.model import Role
from scaraspec.suite.as_client.access import Access
from scaraspec.suite.as_client.probes import probe_all
from scaraspec.suite.as_client.state import restore
from scaraspec.suite.as_client.state.readiness import come_back, make_ready
from scaraspec.suite.as_client.subject import Subject
from scaraspec.suite.expect import Undecided, Unmet
from scaraspec.suite.observer import Observer
from scaraspec.suite.plan import Options
from scaraspec.suite.statement import Statement


@dataclass(frozen=True)
class ControllerSetting:
    """A run against a controller; see `run.Setting`.

    Attributes:
        access: The way to the subject.
        statement: What it claims.
        password: What opens it.
        options: What the tester asks for.
        link: How to call the way to it, in the results.
        capture: The file in which it is recorded, beside the results; empty for none.
        replay: The command line that runs the suite again, without ``--only``.
        state_file: Where the subject's state is kept until it is put back; None for nowhere.
    """

    access: Access
    statement: Statement
    password: bytes
    options: Options
    link: str = ""
    capture: str = ""
    replay: str = ""
    state_file: Path | None = None
    role = Role.CONTROLLER

    @property
    def needs_login(self) -> bool:
        """Whether a login comes first."""
        return self.access.needs_login

    def subject(self, observer: Observer) -> Subject:
        """The controller under test."""
        allowed = self.options.allowed
        return Subject(self.access, self.statement, self.password, observer, allowed)

    def begin(self, subject: Subject) -> Mapping[str, Any]:
        """Write down what it is like.

        Raises:
            Unmet: It is not there.
            OSError: Its state cannot be written down.
        """
        file = self.state_file
        left = restore.load(file) if file else {}
        state = {**restore.save(subject), **left}
        if file and state:
            restore.keep(file, state)
        return state

    def probe(self, subject: Subject) -> None:
        """Find out how it is to be spoken to; this may change what was written down.

        Raises:
            Unmet: It is gone.
        """
        probe_all(subject)

    def make_ready(self, subject: Subject) -> None:
        """Make a robot ready that will not move; what it does wrong the cases find."""
        with suppress(Unmet, Undecided):
            make_ready(subject)
            subject.settle()

    def put_back(self, subject: Subject, state: Mapping[str, Any]) -> list[str]:
        """Put everything back; what could not be is told, and stays written down."""
        if not state:  # nothing may be changed, or nothing was; an earlier run's file stays
            return []
        problems = [*restore.restore(subject, state), *come_back(subject)]
        if self.state_file and not problems:
            self.state_file.unlink(missing_ok=True)
        return problems
