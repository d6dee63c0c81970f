"""Operator terminal: shows sentences to an operator, and reads the lines that the operator types.

Both roles use it. What a line means is defined by its caller, except the two that leave.
"""

import os
import time
from collections.abc import Callable, Iterator
from typing import Final

from scaraspec.suite.engine.expectations import CaseSkipped
from scaraspec.transports.tcp import wait_readable

_READ_BYTES: Final = 4096


class OperatorTerminal:
    """The terminal of an operator.

    Args:
        say: Shows a line to the operator.
        input_fd: The file descriptor of the operator's input.
        guidance: The instructions, shown after a line that has no meaning.
    """

    def __init__(self, say: Callable[[str], None], input_fd: int, guidance: str) -> None:
        self.input_fd = input_fd
        self._say, self._guidance = say, guidance
        self._buffer = b""
        self._last_line = ""

    def show(self, sentence: str) -> None:
        """Show a sentence to the operator."""
        self._last_line = sentence
        self._say(sentence)

    def explain(self) -> None:
        """Show the instructions, and the last sentence again."""
        self._say(self._guidance)
        self._say(self._last_line)

    def lines(self) -> Iterator[str]:
        """Yield the lines that the operator has typed so far.

        Raises:
            CaseSkipped: The operator skips the case with "s".
            KeyboardInterrupt: The operator ends the run with "q", or the input has ended.
        """
        while b"\n" in self._buffer or wait_readable(time.monotonic(), self.input_fd):
            line = self._read_line()
            if line.lower() == "s":
                raise CaseSkipped("the operator skipped the case")
            if line.lower() == "q":
                raise KeyboardInterrupt
            yield line

    def _read_line(self) -> str:
        """Return the next line of the operator.

        Raises:
            KeyboardInterrupt: The input has ended.
        """
        while b"\n" not in self._buffer:
            try:
                data = os.read(self.input_fd, _READ_BYTES)
            except OSError:  # the terminal is gone
                data = b""
            if not data:
                raise KeyboardInterrupt
            self._buffer += data
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line.decode("utf-8", "replace").strip()
