"""The console: executes command lines from a file descriptor, such as stdin, and answers each."""

import asyncio
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from scaraspec.virtual_controller.console_commands import ConsoleCommandError, execute
from scaraspec.virtual_controller.server import Server

MAX_LINE_BYTES: Final = 4096
_READ_BYTES: Final = 4096


class Console:
    """Executes the lines from a file descriptor until its end.

    Args:
        server: The server whose plant the lines change.
        source: The file descriptor: a pipe, a terminal or a file.
        answer: Called for each line with ``ok: ...`` or ``error: ...``.
    """

    def __init__(self, server: Server, source: int, answer: Callable[[str], None]) -> None:
        self._server = server
        self._source = source
        self._answer = answer
        self._loop = asyncio.get_running_loop()
        self._rest = b""
        if sys.platform == "win32":  # its event loops watch only sockets
            threading.Thread(target=self._read_in_thread, daemon=True).start()
            return
        try:
            self._loop.add_reader(source, self._read)
        except PermissionError:  # the event loop cannot watch a regular file: read it directly
            self._loop.call_soon(self._read_file)

    def _read(self) -> None:
        data = os.read(self._source, _READ_BYTES)
        if data:
            self._process(data)
        else:
            self._loop.remove_reader(self._source)

    def _read_in_thread(self) -> None:
        with suppress(RuntimeError):  # the event loop has ended
            while data := os.read(self._source, _READ_BYTES):
                self._loop.call_soon_threadsafe(self._process, data)

    def _read_file(self) -> None:
        data = os.read(self._source, _READ_BYTES)
        if data:
            self._process(data)
            self._loop.call_soon(self._read_file)

    def _process(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._execute(line.decode("utf-8", "backslashreplace"))
        if len(self._rest) > MAX_LINE_BYTES:
            self._rest = b""
            self._answer(f"error: a line has at most {MAX_LINE_BYTES} bytes")

    def _execute(self, line: str) -> None:
        self._server.advance()  # process earlier events before the line changes the plant
        try:
            done = execute(line, self._server.core.plant, self._server.now_s)
        except ConsoleCommandError as error:
            self._answer(f"error: {error}")
        else:
            if done:
                self._answer(f"ok: {done}")
        self._server.advance()
