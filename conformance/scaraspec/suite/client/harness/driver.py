"""Driver: a client under test in a process that uses JSON Lines on stdio.

The process is not trusted. It may crash, hang, write without end, answer nonsense or end early.
Each of these raises an exception, and none blocks the suite. Child processes of the driver are
stopped together with it. The expected answer is not known here and is never sent to the driver.
"""

import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from contextlib import suppress
from typing import IO, Any, Final

from scaraspec.operating_system import split_command
from scaraspec.protocol.fields import show
from scaraspec.suite.client.harness.call import Call
from scaraspec.user_message import UserMessage

_READ_BYTES: Final = 65536
_FLOOD_BYTES: Final = 2**18
_UNMATCHED_LINES: Final = 100
_STDERR_BYTES: Final = 65536
_END_S: Final = 2.0


class DriverError(Exception):
    """The driver violates the driver protocol; the text is one sentence."""


class DriverEndedError(DriverError):
    """The driver process has ended, or does not read its stdin any more."""


class DriverFloodsError(DriverError):
    """The driver writes lines that answer no operation, without end."""


class Driver:
    """The process of a client under test.

    Args:
        command: The command line, run without a shell.

    Raises:
        DriverError: The process cannot be started.
    """

    def __init__(self, command: str) -> None:
        self._command = command
        self._calls: dict[int, Call] = {}
        self._number = 0
        self._buffer = b""
        self._unmatched_bytes = 0
        self._selector: selectors.BaseSelector
        self.unmatched_lines: deque[str] = deque(maxlen=_UNMATCHED_LINES)
        """The lines that answer no operation, the latest last."""
        self._start()

    # ------------------------------------------------------------------ operations

    def begin(self, name: str, /, **values: Any) -> Call:
        """Start an operation without waiting for its answer.

        Raises:
            DriverEndedError: The process has ended, or does not read its stdin any more.
        """
        self._number += 1
        call = self._calls[self._number] = Call(self._number, name, values)
        line = json.dumps({"id": self._number, "do": name, **values}, ensure_ascii=True)
        try:
            self._input.write(line.encode() + b"\n")
            self._input.flush()
        except OSError:
            raise self._ended() from None
        return call

    def pump(self) -> None:
        """Read the lines that the process has written so far.

        Raises:
            DriverEndedError: The process has ended.
            DriverFloodsError: The process writes without end.
        """
        while self._selector.select(0):
            data = os.read(self._output.fileno(), _READ_BYTES)
            if not data:
                raise self._ended()
            self._unmatched_bytes += len(data)
            if self._unmatched_bytes > _FLOOD_BYTES:
                raise DriverFloodsError("the driver keeps writing lines that answer no operation")
            self._buffer += data
            *lines, self._buffer = self._buffer.split(b"\n")
            for line in filter(bytes.strip, lines):
                self._take(line)

    def wait(self, call: Call, within_s: float) -> Call:
        """Wait for the answer to an operation.

        Args:
            call: The operation.
            within_s: The timeout in seconds.

        Raises:
            DriverError: No answer came in time, or the process has ended.
        """
        deadline_s = time.monotonic() + within_s
        while call.answer is None:
            remaining_s = deadline_s - time.monotonic()
            if remaining_s <= 0:
                raise DriverError(
                    UserMessage(
                        "the driver did not answer {call} within {within_s:g} s",
                        call=call.name,
                        within_s=within_s,
                    )
                )
            self._selector.select(remaining_s)
            self.pump()
        return call

    def fileno(self) -> int:
        """Return the file descriptor of its output, for a selector."""
        return self._output.fileno()

    def _take(self, line: bytes) -> None:
        try:
            answer = json.loads(line)
            call = self._calls.pop(answer["id"])
        except (ValueError, KeyError, TypeError, RecursionError):
            self.unmatched_lines.append(show(line))
            return
        self._unmatched_bytes = 0
        call.answer = answer

    # ------------------------------------------------------------------ process

    def _start(self) -> None:
        if sys.platform == "win32":
            raise DriverError(
                "a client is certified on Linux and macOS only: Windows cannot wait for a driver "
                "and a connection at once"
            )
        if not self._command.strip():
            raise DriverError("the driver cannot be started: no program is named")
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process runs
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the tester's own command, without a shell
                split_command(self._command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise DriverError(
                UserMessage(
                    "the driver {command!r} cannot be started: {reason}",
                    command=self._command,
                    reason=reason,
                )
            ) from None
        self._input, self._output = _pipe(self._process.stdin), _pipe(self._process.stdout)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._output, selectors.EVENT_READ)

    def restart(self) -> None:
        """Stop the process and start it again.

        Raises:
            DriverError: The process cannot be started.
        """
        self.close()
        self._calls.clear()
        self._buffer, self._unmatched_bytes = b"", 0
        self._start()

    def close(self) -> None:
        """Stop the process and its child processes."""
        self._selector.close()
        with suppress(OSError):
            self._input.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._output.close()
        self._stderr.close()

    @property
    def stderr(self) -> str:
        """The end of its stderr."""
        size_bytes = self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(0, size_bytes - _STDERR_BYTES))
        return self._stderr.read().decode("utf-8", "replace")

    def _ended(self) -> DriverEndedError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        lines = self.stderr.strip().splitlines()
        last_line = f": {lines[-1][:200]}" if lines else ""
        return DriverEndedError(
            UserMessage(
                "the driver ended with exit status {exit_status}{last_line}",
                exit_status=self._process.poll(),
                last_line=last_line,
            )
        )


def _pipe(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None, "stdin and stdout are opened as pipes"
    return end
