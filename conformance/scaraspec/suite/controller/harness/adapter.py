"""Adapter: how a run against a controller begins and ends."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

from scaraspec.report.model import Role
from scaraspec.suite.controller.harness.access import Access
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.own_files import random_token
from scaraspec.suite.controller.harness.probes import probe_all, probe_unsupported
from scaraspec.suite.controller.harness.requests.lag import probe_lag
from scaraspec.suite.controller.harness.state.readiness import make_ready, return_to_start_pose
from scaraspec.suite.controller.harness.state.recovery import recover
from scaraspec.suite.controller.harness.state.restore import (
    restorable_settings,
    restore,
    snapshot,
)
from scaraspec.suite.controller.harness.state.watch import watch
from scaraspec.suite.controller.harness.two_stage.stop_proof import prove_stop
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal, JournalError
from scaraspec.suite.engine.observer import Observer
from scaraspec.suite.engine.operator import Operator
from scaraspec.suite.engine.plan import Options
from scaraspec.user_message import UserMessage, sentence_of

_NS: Final = 1e9


@dataclass(frozen=True)
class ControllerAdapter:
    """A run against a controller; see `role_adapter.RoleAdapter`.

    Attributes:
        access: The access to the controller.
        ics: Its implementation conformance statement.
        password: Its password.
        options: The options of the user.
        link: The link, as the results name it.
        capture: The file name of the recording beside the results; empty if there is none.
        replay: The reproduction command of the run, without ``--only``.
        journal: Records what the run may change, before it is changed.
        draw_token: Creates the token in the names of the run's files.
        say: Shows a sentence to the user at once.
        operator: Replaces hooks that the ICS does not define; None without an operator.
    """

    access: Access
    ics: Ics
    password: bytes
    options: Options
    link: str = ""
    capture: str = ""
    replay: str = ""
    journal: Journal = field(default_factory=Journal)
    draw_token: Callable[[], str] = random_token
    say: Callable[[str], None] = lambda _: None
    operator: Operator | None = None
    role = Role.CONTROLLER

    @property
    def needs_login(self) -> bool:
        """Whether a login is needed."""
        return self.access.needs_login

    @property
    def settings(self) -> Mapping[str, str]:
        """The options, timeouts and time scale of the run by name, for the results."""
        own = {"patience_s": f"{self.access.wait_limit_s:g}"}
        return {**self.options.summary, **self.ics.timing_summary, **own}

    @property
    def real_time(self) -> bool:
        """Whether the subject's clock is not simulated."""
        return self.access.real_time

    def subject(self, observer: Observer) -> ControllerUnderTest:
        """The controller under test."""
        return ControllerUnderTest(
            self.access,
            self.ics,
            self.password,
            observer,
            self.options.allowed,
            journal=self.journal,
            draw_token=self.draw_token,
            say=self.say,
            operator=self.operator,
        )

    def begin(self, subject: ControllerUnderTest) -> Mapping[str, Any]:
        """Restore the changes of an interrupted run, then write the settings to the journal.

        Raises:
            CaseFailed: The controller cannot be reached.
            RecoveryError: Changes of an interrupted run cannot be restored.
            JournalError: The settings cannot be written to the journal.
        """
        recover(subject)
        line = subject.open()
        before = snapshot(subject, line)
        subject.files.begin(name.encode("latin-1") for name in before["programs"] or ())
        started = datetime.fromtimestamp(subject.now_ns / _NS, UTC).isoformat(timespec="seconds")
        self.journal.begin(started, before)
        state = restorable_settings(subject, line, before)
        if state != before:
            self.journal.write("settings", before=state)
        line.close()
        return state

    def probe(self, subject: ControllerUnderTest) -> None:
        """Find out which readings the controller follows at the open points.

        Raises:
            CaseFailed: The controller cannot be reached any more.
        """
        probe_all(subject)
        probe_unsupported(subject)

    def make_ready(self, subject: ControllerUnderTest) -> None:
        """Prove the emergency stop, make the robot ready to move, and measure its state lag.

        Other defects that appear here are left to the cases.
        """
        prove_stop(subject)
        if subject.stop_failure:
            return
        with suppress(CaseFailed, CaseInconclusive):
            make_ready(subject)
            subject.settle()
            probe_lag(subject)
            subject.settle()

    def watch(self, subject: ControllerUnderTest, for_s: float) -> None:
        """Watch whether another client has caused the failure of a case."""
        watch(subject, for_s)

    def put_back(self, subject: ControllerUnderTest, state: Mapping[str, Any]) -> list[str]:
        """Restore everything and compare with the start; return a sentence for each difference."""
        if not state:  # the run has not begun
            return []
        left = restore(subject)
        return [*left.ours, *left.others, *return_to_start_pose(subject)]

    def finish(self, subject: ControllerUnderTest, state: Mapping[str, Any]) -> list[str]:
        """End the run and remove the journal, unless changes may remain on the controller.

        After a shutdown of the controller nothing moves and no output is on.
        """
        if not state:
            return []
        changes = self.journal.changes
        problems = [self.journal.failure] if self.journal.failure else []
        if subject.off:
            self.journal.confirm("rest")
        if changes.any and not (subject.off and changes.only_outputs):
            self.journal.close()
            subject.notify(
                UserMessage(
                    "Changes of this run may remain on the controller. The next run restores them "
                    "first. The journal {journal} lists them",
                    journal=self.journal.path or "in memory",
                )
            )
            shut_down = (
                ["the controller was shut down before everything was restored"]
                if subject.off
                else []
            )
            return [*problems, *shut_down]
        try:
            self.journal.finish()
        except JournalError as error:
            problems.append(sentence_of(error))
        return problems
