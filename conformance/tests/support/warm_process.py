"""Warm processes: `scaraspec` in a process of its own that need not import its modules first.

Each process is forked from a server that has imported them and collected the cases. It has its own
standard streams, environment, working directory and session, and runs the same entry point as the
installed command.
Tests of the interpreter's start and of terminals start `python -m scaraspec` instead.
"""

import io
import multiprocessing
import os
import subprocess
import sys
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Final

import pytest

from scaraspec.cli.main import main
from scaraspec_recorder.child_process import safe_import_path

_PRELOADED: Final = (
    "scaraspec.cli.main",
    "scaraspec.api.certify",
    "scaraspec.api.auditing",
    "scaraspec.cli.certify.client_run",
    "scaraspec.cli.certify.controller_run",
    "scaraspec.cli.controller",
    "scaraspec.cli.record",
    "scaraspec.suite.engine.run",
    "scaraspec_recorder.recordings.archive",
    "scaraspec.suite.controller.harness.adapter",
    "scaraspec.suite.client.harness.adapter",
    "collected_cases",
)
_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload([*_PRELOADED])


class WarmProcess:
    """A running command, with the methods of `subprocess.Popen` that the tests use.

    Args:
        arguments: The arguments after ``scaraspec``.
        merged: Whether standard error goes to the same pipe as standard output.
        viewer: Whether it finds the extra ``view``, and draws what it records.

    Attributes:
        stdout: What it prints.
        stderr: What it prints as errors; None if that is in `stdout`.
    """

    def __init__(self, *arguments: str, merged: bool, viewer: bool = False) -> None:
        self.stdout, out = _pipe()
        self.stderr: IO[str] | None
        self.stderr, error = (None, out) if merged else _pipe()
        self._process = _context.Process(
            target=_command,
            args=(arguments, dict(os.environ), Path.cwd(), out, error),
            kwargs={"viewer": viewer},
        )
        with safe_import_path(), pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # the server has no other
            self._process.start()
        out.close()
        error.close()
        assert self._process.pid is not None
        self.pid = self._process.pid

    @property
    def returncode(self) -> int | None:
        """The exit status; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit status; None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end, and return the exit status.

        Raises:
            subprocess.TimeoutExpired: It still runs.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired("scaraspec", timeout or 0)
        return self._process.exitcode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Read everything that it prints, and wait for its end.

        Raises:
            subprocess.TimeoutExpired: It still runs.
        """
        texts = ["", ""]

        def read(number: int, stream: IO[str]) -> None:
            with suppress(ValueError):  # it is closed already
                texts[number] = stream.read()
                stream.close()

        streams = [s for s in (self.stdout, self.stderr) if s is not None]
        readers = [threading.Thread(target=read, args=each) for each in enumerate(streams)]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join()
        return texts[0], texts[1]

    def send_signal(self, number: int) -> None:
        """Send a signal to it, if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._process.terminate()

    def kill(self) -> None:
        """Send SIGKILL."""
        self._process.kill()


def _pipe() -> tuple[IO[str], Connection]:
    reader, writer = _context.Pipe(duplex=False)
    stream = open(os.dup(reader.fileno()), encoding="utf-8", errors="replace")  # noqa: SIM115, PTH123 - the caller closes this descriptor
    reader.close()
    return stream, writer


def _command(  # noqa: PLR0913 - what it has from the process that starts it
    arguments: tuple[str, ...],
    environment: dict[str, str],
    folder: Path,
    out: Connection,
    error: Connection,
    *,
    viewer: bool,
) -> None:
    """Become the command; runs in the new process."""
    os.setsid()
    if not viewer:
        sys.modules["rerun"] = None  # type: ignore[assignment] # as if it were not installed
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    for number, name, pipe in ((1, "stdout", out), (2, "stderr", error)):
        os.dup2(pipe.fileno(), number)
        stream = io.TextIOWrapper(
            io.BufferedWriter(io.FileIO(number, "w", closefd=False)),
            "utf-8",
            line_buffering=number == 2,
        )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    out.close()
    if error is not out:
        error.close()
    sys.argv = ["scaraspec", *arguments]
    main()
