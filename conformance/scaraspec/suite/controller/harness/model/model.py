"""Model: the expected state of the controller after each request of a sequence.

The model remembers the requests: files, settings, outputs, the executing command. A step without
a meaning in the current state, such as a query for the default program before one was set, is
skipped. So every part of a sequence is a valid sequence. If the document permits a refusal, the
model follows the reply. If the document leaves an outcome open, the model expects nothing.
"""

from typing import TYPE_CHECKING, Final

from scaraspec.protocol.fields import show
from scaraspec.suite.controller.harness.malformed.delivery import longest_pause_s
from scaraspec.suite.controller.harness.model.execution import ExecutionSteps
from scaraspec.suite.controller.harness.model.settings import SettingSteps
from scaraspec.suite.controller.harness.model.state import READING, VALUES, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    stop_motion,
)
from scaraspec.suite.controller.harness.requests.passwords import (
    request_password_change,
)
from scaraspec.suite.controller.harness.requests.ports import (
    set_output,
)
from scaraspec.suite.controller.harness.requests.queries import supported_queries
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, RequestAbandoned, expect_equal
from scaraspec.suite.program_files.listed import program_names, store_program
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from collections.abc import Callable

_CONSTANT: Final = ("get_version", "get_network")

_REPORTED_STEPS: Final = 8
"""How many of the last steps of a failing sequence the message names."""

_SERVED: Final = frozenset({*READING, "set_centre", "set_initial", "set_output"})
"""Steps that a responsive robot serves or refuses while a program executes (A-4-3)."""
_WHILE_EXECUTING: Final = _SERVED | {"run", "simulate", "stop"}
"""Steps that run while a program executes; every other step stops the program first."""


class Model(SettingSteps, ExecutionSteps):
    """Performs the steps of a sequence and checks the results; see `ModelState`."""

    def perform(self, step: Step) -> None:
        """Perform a step and check its result.

        Raises:
            CaseFailed: The controller differs from the model; the message names the earlier steps.
        """
        perform: Callable[[Step, OutgoingConnection], str | None] = getattr(self, f"_{step.act}")
        line = self._lines[step.line % len(self._lines)]
        try:
            if self._running and step.act not in _WHILE_EXECUTING:
                self._stop(step, line)
                self.history.append(UserMessage("stop"))
            if step.act in _SERVED and self._unresponsive:
                return
            line.cuts = step.cuts
            if step.slow:
                line.long_pause_s = longest_pause_s(self._subject)
            description = perform(step, line)
        except RequestAbandoned:
            # The first request of the step is not complete: nothing has changed.
            if self._running:
                raise
            self._replace(line)
            return
        except CaseFailed as error:
            self._add_history(error, step.act)
            raise
        finally:
            line.cuts, line.long_pause_s = (), 0.0
        if description:
            self.history.append(description)

    def check(self) -> None:
        """Compare the whole state of the controller with the model.

        Raises:
            CaseFailed: The controller differs from the model; the message names the earlier steps.
        """
        steps = len(self.history)
        for number, act in enumerate(dict.fromkeys(self._acts)):
            if act == "download":
                for which in range(len(self._files)):
                    self.perform(Step(act, which, 0, which))
            elif act in READING:
                self.perform(Step(act, 0, 0, number))
            del self.history[steps:]

    def clean_up(self) -> None:
        """Stop the robot, delete all files and close the connections.

        Raises:
            CaseFailed: The controller refuses.
        """
        try:
            line = self._lines[0] = ensure_open(self._subject, self._lines[0])
            if self._subject.moved:
                stop_motion(self._subject, line)
            self._settle_transfer(line)
            for name in self._files:
                if (
                    not line.ask("delete_program", data=name).accepted
                    and name == self._accepted_default
                ):
                    self._delete_default(name, line)
            if "set_output" in self._acts:
                for port in self._ports:
                    if any(
                        self._before[port - 1] != bits[port - 1] for bits in self._outputs.values()
                    ):
                        set_output(line, port, on=self._before[port - 1])
            if self._password != self._subject.password:
                request_password_change(line, self._password, self._subject.password)
        finally:
            self._subject.close_lines()

    def _delete_default(self, name: bytes, line: OutgoingConnection) -> None:
        """Delete a program that cannot be deleted while it is the default program (A-4.11-1)."""
        line.ask("set_default_program", store_program(self._subject, line))
        line.ask("delete_program", data=name)

    def _add_history(self, error: CaseFailed, act: str) -> None:
        reported = self.history[-_REPORTED_STEPS:] or [UserMessage("nothing")]
        steps = UserMessage.listed(reported, semicolons=True)
        omitted = len(self.history) - _REPORTED_STEPS
        if omitted > 0:
            steps = UserMessage("… {count} steps; {steps}", count=omitted, steps=steps)
        error.args = (
            UserMessage("{error}, in {step} after: {steps}", error=error, step=act, steps=steps),
        )
        if isinstance(error, NoReply):
            error.requirement = error.requirement or error.reply_requirement

    def _query(self, step: Step, line: OutgoingConnection) -> str | None:
        queries = supported_queries(self._subject)
        query = queries[(step.which * VALUES + step.value) % len(queries)]
        if query.name == "list_programs":  # all parts: the next list would begin with the rest
            program_names(self._subject, line)
            return query.name
        data = line.ask(*query).frame.data
        if query.name in _CONSTANT:
            expect_equal(
                show(data),
                show(self._constant.setdefault(query.name, data)),
                UserMessage("the reply to {query} differs from the reply before", query=query.name),
                requirement="4.7/4" if query.name == "get_version" else "4.3/2",
            )
        return query.name
