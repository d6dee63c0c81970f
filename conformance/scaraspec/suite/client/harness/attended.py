"""Attended: a client without a driver, worked by an operator who is told what to do next.

What the client sends shows that it was done; what the client shows, the operator is asked. A line
that he types meanwhile may skip a step or leave the sitting.
"""

import os
import socket
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.watched_link import WatchedLink
from scaraspec.suite.engine.expectations import CaseSkipped
from scaraspec.transports.clock import now_ns
from scaraspec.transports.link import Link
from scaraspec.transports.tcp import wait_readable

_READ_BYTES: Final = 4096
_ANSWERS: Final = {"y": True, "yes": True, "n": False, "no": False}
HELP: Final = (
    'Do what follows "now", as soon as it is said. Type y = yes, n = no, or: the client refuses to '
    "do it; s = skip this case, q = leave (the same --out goes on later), ? = say it again."
)
"""What an operator has to know."""


class Attended:
    """A client worked by an operator; see `access.Access`.

    Args:
        host: Where to listen.
        port: The port; 0 for any.
        say: Tells the operator a line.
        answer_s: For how long he may take over a step.
        input_fd: Where his lines come from.

    Raises:
        OSError: Nobody can listen there.
    """

    attended = True
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
        self._say, self._input_fd = say, input_fd
        self._held = b""
        self._told = ""
        self._number = 0
        self._asked: Call | None = None

    @property
    def now_ns(self) -> int:
        """See `links.clock`."""
        return now_ns()

    @property
    def now_s(self) -> float:
        """The system's monotonic clock."""
        return time.monotonic()

    def begin(self, name: str, /, **values: Any) -> Call:
        """Tell the operator what to do; hanging up is done by us."""
        self._number += 1
        call = Call(self._number, name, values)
        if name == "disconnect":
            call.answer = {"ok": True}
        else:
            given = ", ".join(f"{key} = {value}" for key, value in values.items())
            self._tell(f"now: {name}" + (f" with {given}" if given else ""))
            self._asked = call
        return call

    def pump(self) -> None:
        """Take what the operator has typed.

        Raises:
            CaseSkipped: He skips the case.
            KeyboardInterrupt: He leaves.
        """
        while b"\n" in self._held or wait_readable(time.monotonic(), self._input_fd):
            self._obey(self._line())

    def wait(self, deadline_s: float) -> None:
        """Wait until he types something."""
        wait_readable(deadline_s, self._input_fd)

    def accept(self, deadline_s: float) -> Link | None:
        """Take a connection."""
        if self._listener not in wait_readable(deadline_s, self._input_fd, self._listener):
            return None
        connected, _ = self._listener.accept()
        return WatchedLink(connected, self._input_fd)

    def listen_at_default(self) -> bool:
        """The operator has been told where to connect."""
        return False

    def ask_operator(self, sentence: str) -> Call | None:
        """Ask him whether the client shows this; he says so when he has seen it."""
        self._asked = question = Call(0, "", {})
        self._tell(f"does the client show that {sentence}? [y/n]")
        return question

    def restart(self) -> None:
        """The operator sees to that by himself."""
        self._tell("the client seems to hang: start it anew")

    def close(self) -> None:
        """Listen no more, and take the files away."""
        self._listener.close()
        self._scratch.cleanup()

    def _tell(self, sentence: str) -> None:
        self._told = sentence
        self._say(sentence)

    def _obey(self, line: str) -> None:
        """Do what he types: he answers the question, or says that the client refuses the order."""
        answer, asked = _ANSWERS.get(line), self._asked
        if line == "s":
            raise CaseSkipped("the operator skipped it")
        if line == "q":
            raise KeyboardInterrupt
        if answer is None or asked is None or (asked.name and answer):
            self._say(f"{HELP}\n{self._told}")
        else:
            self._asked = None
            asked.answer = {"ok": answer}

    def _line(self) -> str:
        """The next line that he types.

        Raises:
            KeyboardInterrupt: There will be none.
        """
        while b"\n" not in self._held:
            try:
                data = os.read(self._input_fd, _READ_BYTES)
            except OSError:  # his terminal is lost
                data = b""
            if not data:
                raise KeyboardInterrupt
            self._held += data
        line, _, self._held = self._held.partition(b"\n")
        return line.decode("utf-8", "replace").strip().lower()
