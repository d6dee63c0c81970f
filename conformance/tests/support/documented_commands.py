"""Runs the commands of a page of the documentation in the order of the page.

A block of the language ``sh`` is run in a new shell, in the folder of the page. A comment directly
before the block changes that:

- ``<!-- not run: REASON -->``: it needs root, a real robot or the like, or another test runs it.
- ``<!-- prepare: COMMAND -->``: a command that is run first, such as one that makes an input file.
- ``<!-- exit status: 3 -->``: the exit status of the block. Without it each command must succeed.
- ``<!-- runs until: TEXT -->``: it continues to run, and has started when its output has the text.
  It gets SIGINT after the last block.
- ``<!-- stop: COMMAND -->``: the running block that begins with the command gets SIGINT first.

A paragraph that begins with a file name in backticks names the file that the next block is the
content of. A block ``text`` after a block that was run is its output: each line must occur in it,
and ``…`` replaces any characters.
"""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[3]
_BLOCK: Final = re.compile(
    r"^(?:`(?P<file>[\w/-]*\.[\w.-]+)`(?: [^\n]*)?\n(?:[^\n]+\n)*\n)?"
    r"(?P<marks>(?:<!-- [^\n]* -->\n)*)```(?P<language>\w+)\n(?P<text>(?:(?!```)[^\n]*\n)*)```$",
    re.MULTILINE,
)
_MARK: Final = re.compile(r"<!-- (not run|prepare|exit status|runs until|stop): (.*?) -->")
_ADDRESS: Final = re.compile(r"(127\.0\.0\.1|0\.0\.0\.0|192\.168\.1\.2)(:88\d\d)?(?![\d.])")
_EXTRA: Final = re.compile(r"scaraspec\[([\w,]+)\]|extras? `(\w+)`")
_TABLES: Final = ("pyarrow",)
_ARCHIVE: Final = (*_TABLES, "scapy", "duckdb", "fsspec")
_MODULES: Final = {
    "view": ("rerun", "numpy", *_TABLES),
    "pcap": ("scapy",),
    "serial": ("serial",),
    "tables": _TABLES,
    "metrics": ("prometheus_client",),
    "archive": _ARCHIVE,
    "s3": (*_ARCHIVE, "s3fs"),
    "dask": (*_ARCHIVE, "distributed"),
}
"""The modules that an extra installs."""
TIMEOUT_S: Final = 900
_POLL_S: Final = 0.05


@dataclass(frozen=True)
class Block:
    """A fenced block of a page.

    Attributes:
        language: Its language.
        text: Its text.
        marks: The comments before it, by name.
        file: The file that it is the content of; empty if it is none.
        line: Its line in the page.
    """

    language: str
    text: str
    marks: dict[str, str]
    file: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page that have a language."""
    text = page.read_text("utf-8")
    for match in _BLOCK.finditer(text):
        yield Block(
            match["language"],
            match["text"],
            dict(_MARK.findall(match["marks"])),
            match["file"] or "",
            text.count("\n", 0, match.start("text")),
        )


def free_port() -> int:
    """Return a free TCP port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@dataclass
class Reader:
    """Someone who follows a page in a new folder.

    Attributes:
        folder: The folder.
        robot: The address of the controller that replaces 192.168.1.2.
        variables: The environment of all commands.
    """

    folder: Path
    robot: str
    variables: dict[str, str]
    _ports: dict[str, int] = field(default_factory=dict)
    _started: list[subprocess.Popen[bytes]] = field(default_factory=list)
    _running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _output: Path = Path()

    def local(self, text: str) -> str:
        """Return text of the page with free ports, and with the controller of the test."""

        def address(match: re.Match[str]) -> str:
            if match[1] == "192.168.1.2":
                return self.robot
            if not match[2]:
                return match[0]
            if match[2] not in self._ports:
                self._ports[match[2]] = free_port()
            return f"127.0.0.1:{self._ports[match[2]]}"

        return _ADDRESS.sub(address, text)

    def follow(self, page: Path) -> int:
        """Write the files of a page, run its blocks, and return how many were run."""
        output = None
        count = 0
        try:
            for block in blocks(page):
                if block.file:
                    (self.folder / block.file).write_text(self.local(block.text), "utf-8")
                elif block.language == "sh":
                    is_run = "not run" not in block.marks
                    output = self._run(block) if is_run else None
                    count += is_run
                elif block.language == "text" and output is not None:
                    self._compare(block, output)
        finally:
            self._end()
        return count

    def _run(self, block: Block) -> str:
        if "stop" in block.marks:
            self._stop(block.marks["stop"])
        if "prepare" in block.marks:
            self._finish(self._start(block.marks["prepare"]), 0, block)
        process = self._start(block.text)
        if "runs until" not in block.marks:
            return self._finish(process, int(block.marks.get("exit status", 0)), block)
        self._running[block.text] = process
        text = self.local(block.marks["runs until"])
        while text not in (output := self._output.read_text("utf-8")):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_POLL_S)
                raise AssertionError(f"line {block.line}:\n{block.text}\n{output}")
        return output

    def _start(self, commands: str) -> subprocess.Popen[bytes]:
        self._output = self.folder.parent / f"output-{len(self._started)}"
        with self._output.open("wb") as output:
            process = subprocess.Popen(
                ["bash", "-ec", self.local(commands)],
                cwd=self.folder,
                env=self.variables,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._started.append(process)
        return process

    def _finish(self, process: subprocess.Popen[bytes], expected: int, block: Block) -> str:
        status = process.wait(TIMEOUT_S)
        output = self._output.read_text("utf-8")
        assert status == expected, f"line {block.line}: {status}\n{block.text}\n{output}"
        return output

    def _compare(self, block: Block, output: str) -> None:
        for line in self.local(block.text).splitlines():
            pattern = ".*?".join(map(re.escape, line.strip().split("…")))
            assert re.search(pattern, output), f"line {block.line}: {line}\n{output}"

    def _stop(self, beginning: str) -> None:
        """Send SIGINT to the running block that begins so, and wait for its end."""
        (process,) = (each for text, each in self._running.items() if text.startswith(beginning))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
        process.wait(TIMEOUT_S)

    def _end(self) -> None:
        """End what still runs: the blocks that run until Ctrl-C, and processes with ``&``."""
        for commands in reversed(self._running):
            self._stop(commands)
        for process in self._started:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)


def extras_of(page: Path) -> set[str]:
    """Return the extras that a page names, so that its reader has installed them."""
    found = _EXTRA.findall(page.read_text("utf-8"))
    return {extra for names in found for name in names if name for extra in name.split(",")}


def hide_extras(folder: Path, installed: AbstractSet[str] = frozenset()) -> None:
    """Write a file that hides the modules of extras from each Python with `folder` in its path."""
    present = {module for extra in installed for module in _MODULES[extra]}
    hidden = {module for modules in _MODULES.values() for module in modules} - present
    (folder / "sitecustomize.py").write_text(
        "from importlib.machinery import PathFinder\n"
        "find = PathFinder.find_spec\n"
        "def find_spec(name, path=None, target=None):\n"
        f"    hidden = name.partition('.')[0] in {hidden!r}\n"
        "    return None if hidden else find(name, path, target)\n"
        "PathFinder.find_spec = find_spec\n"
    )


def variables_for(folder: Path, page: Path) -> dict[str, str]:
    """Return an environment in which `scaraspec` is this version, with its own state.

    Args:
        folder: A folder for its files.
        page: The page whose reader it is for: only the extras that it names are installed.
    """
    hide_extras(folder, extras_of(page))
    programs = folder / "bin"
    programs.mkdir()
    program = programs / "scaraspec"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m scaraspec "$@"\n', "utf-8")
    program.chmod(0o755)
    return os.environ | {
        "PATH": f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(filter(None, (f"{folder}", os.environ.get("PYTHONPATH")))),
        "SCARASPEC_STATE": f"{folder / 'state'}",
        "PYTHONUNBUFFERED": "1",
        "REPOSITORY": f"{ROOT}",
    }
