"""Attended run: an operator controls a client that has no driver.

The suite prints each step. The traffic of the client shows that the step was done. The suite asks
the operator what the client displays. At any time the operator can type a line to skip the case or
to end the run.
"""

import socket
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.watched_link import WatchedLink
from scaraspec.suite.engine.operator_terminal import OperatorTerminal
from scaraspec.transports.clock import now_ns
from scaraspec.transports.link import Link
from scaraspec.transports.tcp import wait_readable
from scaraspec.user_message import UserMessage

_ANSWERS: Final = {"y": True, "yes": True, "n": False, "no": False}
HELP: Final = (
    'Do the step after "now:" as soon as it appears. Type y = yes, n = no or the client refuses '
    "the step, s = skip this case, q = quit (the same --out continues later), ? = repeat the step."
)
"""The instructions for the operator."""


class Attended:
    """Access to a client that an operator controls; see `access.Access`.

    Args:
        host: The address to listen at.
        port: The port to listen at; 0 for any.
        say: Shows a line to the operator.
        answer_timeout_s: How long the operator may take for a step.
        input_fd: The file descriptor of the operator's input.

    Raises:
        OSError: The suite cannot listen at this address and port.
    """

    attended = True
    real_time = True
    unmatched_lines: Sequence[str] = ()
    complaints = ""

    def __init__(
        self,
        host: str,
        port: int,
        say: Callable[[str], None],
        *,
        answer_timeout_s: float = 600.0,
        input_fd: int = 0,
    ) -> None:
        self._listener = socket.create_server((host, port))
        self.host, self.port = self._listener.getsockname()[:2]
        self.connected_port = self.port
        self.answer_timeout_s = answer_timeout_s
        self._scratch = tempfile.TemporaryDirectory(prefix="scaraspec-")
        self.folder = Path(self._scratch.name)
        self._terminal = OperatorTerminal(say, input_fd, HELP)
        self._number = 0
        self._open_question: Call | None = None

    @property
    def now_ns(self) -> int:
        """See `transports.clock`."""
        return now_ns()

    @property
    def now_s(self) -> float:
        """The monotonic clock of the system."""
        return time.monotonic()

    def begin(self, name: str, /, **values: Any) -> Call:
        """Show the step to the operator. The suite itself closes connections."""
        self._number += 1
        call = Call(self._number, name, values)
        if name == "disconnect":
            call.answer = {"ok": True}
        else:
            parameters = ", ".join(f"{key} = {value}" for key, value in values.items())
            template = "now: {name} with {parameters}" if parameters else "now: {name}"
            self._terminal.show(UserMessage(template, name=name, parameters=parameters))
            self._open_question = call
        return call

    def pump(self) -> None:
        """Process the lines that the operator has typed.

        Raises:
            CaseSkipped: The operator skips the case.
            KeyboardInterrupt: The operator ends the run.
        """
        for line in self._terminal.lines():
            self._handle_input(line.lower())

    def wait(self, deadline_s: float) -> None:
        """Wait until the operator types a line or the deadline passes."""
        wait_readable(deadline_s, self._terminal.input_fd)

    def accept(self, deadline_s: float) -> Link | None:
        """Return the next connection; None at the deadline or if the operator types first."""
        if self._listener not in wait_readable(deadline_s, self._terminal.input_fd, self._listener):
            return None
        connected, _ = self._listener.accept()
        return WatchedLink(connected, self._terminal.input_fd)

    def listen_at_default(self) -> bool:
        """Return False: the operator already knows the address and the port."""
        return False

    def ask_operator(self, sentence: str) -> Call | None:
        """Ask the operator whether the client shows that the sentence is true."""
        self._open_question = question = Call(0, "", {})
        self._terminal.show(
            UserMessage("does the client show that {sentence}? [y/n]", sentence=sentence)
        )
        return question

    def restart(self) -> None:
        """Ask the operator to restart the client."""
        self._terminal.show("the client does not respond: restart it")

    def close(self) -> None:
        """Stop listening and remove the files."""
        self._listener.close()
        self._scratch.cleanup()

    def _handle_input(self, line: str) -> None:
        """Handle a line: the answer to the question, or "n" because the client refuses the step."""
        answer, question = _ANSWERS.get(line), self._open_question
        if answer is None or question is None or (question.name and answer):
            self._terminal.explain()
        else:
            self._open_question = None
            question.answer = {"ok": answer}
