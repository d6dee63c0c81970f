"""Driver: a client under test as a process that speaks JSON Lines on stdio.

The process is not trusted: it may crash, hang, flood, answer nonsense or end early. Each of these
is told by an exception of its own, none keeps the suite waiting, and what the process leaves
behind is ended with it. What an answer should be is not known here, and never sent.
"""

import json
import os
import selectors
import shlex
import signal
import subprocess
import tempfile
import time
from collections import deque
from contextlib import suppress
from typing import IO, Any, Final

from scaraspec.protocol.fields import show
from scaraspec.suite.client.harness.call import Call
from scaraspec.user_message import UserMessage

_READ_BYTES: Final = 65536
_FLOOD_BYTES: Final = 2**18
_STRAY_LINES: Final = 100
_STDERR_BYTES: Final = 65536
_END_S: Final = 2.0


class DriverError(Exception):
    """The driver does not keep to its protocol; one sentence."""


class DriverEndedError(DriverError):
    """The driver's process has ended, or does not take orders any more."""


class DriverBabblesError(DriverError):
    """The driver writes what nobody can use, without end."""


class Driver:
    """The process of a client under test.

    Args:
        command: Its command line, run without a shell.

    Raises:
        DriverError: It cannot be started.
    """

    def __init__(self, command: str) -> None:
        self._command = command
        self._calls: dict[int, Call] = {}
        self._number = 0
        self._held = b""
        self._said_bytes = 0
        self._selector: selectors.BaseSelector
        self.unmatched_lines: deque[str] = deque(maxlen=_STRAY_LINES)
        """Lines that answer nothing, the latest last."""
        self._start()

    # ------------------------------------------------------------------ asking

    def begin(self, name: str, /, **values: Any) -> Call:
        """Ask for an operation, and go on.

        Raises:
            DriverEndedError: The process has ended, or reads no more.
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
        """Take what the process has said so far.

        Raises:
            DriverEndedError: It has ended.
            DriverBabblesError: It floods.
        """
        while self._selector.select(0):
            data = os.read(self._output.fileno(), _READ_BYTES)
            if not data:
                raise self._ended()
            self._said_bytes += len(data)
            if self._said_bytes > _FLOOD_BYTES:
                raise DriverBabblesError("the driver goes on writing what answers nothing")
            self._held += data
            *lines, self._held = self._held.split(b"\n")
            for line in filter(bytes.strip, lines):
                self._take(line)

    def wait(self, call: Call, within_s: float) -> Call:
        """Wait for the answer of an operation.

        Raises:
            DriverError: None came in time, or the process has ended.
        """
        deadline_s = time.monotonic() + within_s
        while call.answer is None:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0:
                raise DriverError(
                    UserMessage(
                        "the driver has not answered {call} in {within_s:g} s",
                        call=call.name,
                        within_s=within_s,
                    )
                )
            self._selector.select(left_s)
            self.pump()
        return call

    def fileno(self) -> int:
        """Of its output, for whoever waits for several things."""
        return self._output.fileno()

    def _take(self, line: bytes) -> None:
        try:
            answer = json.loads(line)
            call = self._calls.pop(answer["id"])
        except (ValueError, KeyError, TypeError, RecursionError):
            self.unmatched_lines.append(show(line))
            return
        self._said_bytes = 0
        call.answer = answer

    # ------------------------------------------------------------------ its life

    def _start(self) -> None:
        if not self._command.strip():
            raise DriverError("the driver cannot be started: no program is named")
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the process
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the tester's own command, without a shell
                shlex.split(self._command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise DriverError(
                UserMessage(
                    "the driver {command!r} cannot be started: {why}",
                    command=self._command,
                    why=why,
                )
            ) from None
        self._input, self._output = _pipe(self._process.stdin), _pipe(self._process.stdout)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._output, selectors.EVENT_READ)

    def restart(self) -> None:
        """End it and start it anew.

        Raises:
            DriverError: It cannot be started.
        """
        self.close()
        self._calls.clear()
        self._held, self._said_bytes = b"", 0
        self._start()

    def close(self) -> None:
        """End it with everything that it has started."""
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
        """The end of what it has complained of."""
        size_bytes = self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(0, size_bytes - _STDERR_BYTES))
        return self._stderr.read().decode("utf-8", "replace")

    def _ended(self) -> DriverEndedError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        said = self.stderr.strip().splitlines()
        why = UserMessage(": {said}", said=said[-1][:200]) if said else ""
        return DriverEndedError(
            UserMessage(
                "the driver has ended with status {poll}{why}", poll=self._process.poll(), why=why
            )
        )


def _pipe(end: IO[bytes] | None) -> IO[bytes]:
    assert end is not None, "both ends were asked for as pipes"
    return end
