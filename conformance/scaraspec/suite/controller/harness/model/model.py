"""Model: what the controller must be like after a sequence of requests, step by step.

The model remembers the requests: files, settings, outputs, the executing command. A step without
a meaning in the current state, such as a query for the default program before one was set, is
skipped. So every part of a sequence is a sequence again. If the document permits a refusal, the
model follows the reply. If the document leaves an outcome open, the model expects nothing.
"""

from typing import TYPE_CHECKING, Final

from scaraspec.protocol.fields import show
from scaraspec.suite.controller.harness.model.connections import ConnectionSteps
from scaraspec.suite.controller.harness.model.execution import ExecutionSteps
from scaraspec.suite.controller.harness.model.settings import SettingSteps
from scaraspec.suite.controller.harness.model.state import VALUES, Step
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
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect_equal
from scaraspec.suite.program_files.listed import program_names, store_program
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from collections.abc import Callable

_CONSTANT: Final = ("get_version", "get_network")

_TOLD: Final = 8
"""How many of the last steps of a failing sequence the message has."""

_MEANWHILE: Final = frozenset(
    {"look", "query", "get_clock", "get_outputs", "run", "simulate", "stop"}
)
"""What is done while a program executes; before all else it is stopped."""


class Model(ConnectionSteps, SettingSteps, ExecutionSteps):
    """Performs the steps of a sequence and checks what follows from them; see `ModelState`."""

    def perform(self, step: Step) -> None:
        """Do a step, and check what follows from it.

        Raises:
            CaseFailed: The subject is not as it has to be; the message has the steps before.
        """
        act: Callable[[Step, OutgoingConnection], str | None] = getattr(self, f"_{step.act}")
        line = self._lines[step.line % len(self._lines)]
        try:
            if self._running and step.act not in _MEANWHILE:
                self._stop(step, line)
                self.history.append("stop")
            said = act(step, line)
        except CaseFailed as error:
            self._tell(error, step.act)
            raise
        if said:
            self.history.append(said)

    def check(self) -> None:
        """Look at all that is known.

        Raises:
            CaseFailed: The subject is not as it has to be; the message has the steps before.
        """
        for act in dict.fromkeys(self._acts):
            if act == "download":
                for which in range(len(self._files)):
                    self.perform(Step(act, which, 0, 0))
            elif act.startswith(("look", "list_", "get_")):
                self.perform(Step(act, 0, 0, 0))

    def clean_up(self) -> None:
        """Stop what executes, take away all files, and end the connections.

        Raises:
            CaseFailed: The subject does not obey.
        """
        try:
            line = self._lines[0] = ensure_open(self._subject, self._lines[0])
            if self._subject.moved:
                stop_motion(self._subject, line)
            self._settle_transfer(line)
            for name in self._files:
                if not line.ask("delete_program", data=name).accepted and name == self._named:
                    self._let_go(name, line)
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

    def _let_go(self, name: bytes, line: OutgoingConnection) -> None:
        """Delete a program that had to stay as long as it was the default one (A-4.11-1)."""
        line.ask("set_default_program", store_program(self._subject, line))
        line.ask("delete_program", data=name)

    def _tell(self, error: CaseFailed, act: str) -> None:
        behind = "; ".join(self.history[-_TOLD:]) or "nothing"
        more = f"… {len(self.history) - _TOLD} steps; " if len(self.history) > _TOLD else ""
        error.args = (f"{error}, in {act} after: {more}{behind}",)
        if isinstance(error, NoReply):
            error.requirement = error.requirement or error.owed

    def _query(self, step: Step, line: OutgoingConnection) -> str | None:
        queries = supported_queries(self._subject)
        query = queries[(step.which * VALUES + step.value) % len(queries)]
        if self._deaf:
            return None
        if query.name == "list_programs":  # the whole of it: the rest would be the next one's
            program_names(self._subject, line)
            return query.name
        data = line.ask(*query).frame.data
        if query.name in _CONSTANT:
            expect_equal(
                show(data),
                show(self._constant.setdefault(query.name, data)),
                UserMessage("{query} is answered otherwise than before", query=query.name),
                requirement="4.7/4" if query.name == "get_version" else "4.3/2",
            )
        return query.name
