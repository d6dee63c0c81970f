"""``scaraspec controller``: the virtual controller on a TCP port and, if asked, a serial device."""

import asyncio
import contextlib
import errno
import logging
import os
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import click

from scaraspec.cli.options import Real, password_option
from scaraspec.cli.problems import Problem, no_such_mutant
from scaraspec.mutants.controller import mutants
from scaraspec.operating_system import on_ending_signals
from scaraspec.protocol.frames import StreamItem
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.protocol.readings import Dialect, ReadingError
from scaraspec.translation import localized
from scaraspec.transports.link import LinkError
from scaraspec.transports.url import Serial, join_host_port, parse, split_host_port
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec.virtual_controller.behaviour.settings import PASSWORD_MAX_BYTES
from scaraspec.virtual_controller.console import Console
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.serial_port import SerialPort, SerialPortError
from scaraspec.virtual_controller.server import Server
from scaraspec.virtual_controller.store import DirectoryStore, Store, StoreError, import_programs
from scaraspec.virtual_controller.traffic_log import format_line

_logger = logging.getLogger("scaraspec.virtual_controller")
_PATH = click.Path(path_type=Path)
_SCALE = Real(0.001, 1000)
_LISTEN = f"127.0.0.1:{DEFAULT_PORT}"

_EPILOG = """\b
Example: a controller of another dialect on any free port
  scaraspec controller --listen 127.0.0.1:0 --data robot --reading endian=big
"""


@dataclass(frozen=True, slots=True)
class _Options:
    """Where the controller listens, and how it starts."""

    host: str
    port: int
    time_scale: float
    serial: Serial | None
    control: bool
    ready_file: Path | None


@click.command(epilog=_EPILOG)
@click.option(
    "--listen",
    default=_LISTEN,
    metavar="HOST:PORT",
    help=f"Address to listen on [{_LISTEN}]; port 0 selects a free port.",
)
@password_option(None, "Password of the controller")
@click.option("--data", type=_PATH, metavar="DIR", help="Keep programs and settings here.")
@click.option(
    "--time-scale", type=_SCALE, default=1.0, metavar="X", help="Run the clock X times as fast."
)
@click.option("--programs", type=_PATH, metavar="DIR", help="Store the files of this folder first.")
@click.option("--serial", metavar="DEV", help="Also serve a serial device, such as /dev/rfcomm0.")
@click.option(
    "--reading",
    "readings",
    multiple=True,
    metavar="KEY=OPTION",
    help="Follow this reading of an open point; repeatable.",
)
@click.option(
    "--mutant", metavar="ID", help="Run this faulty controller; see scaraspec prove --list."
)
@click.option("--fault", metavar="ID", hidden=True)  # the old name of --mutant
@click.option(
    "--control",
    is_flag=True,
    help="Accept commands on stdin, such as faults and inputs; help lists them.",
)
@click.option(
    "--ready-file", type=_PATH, metavar="FILE", help="Write host:port to this file when ready."
)
@click.option("-v", "--verbose", is_flag=True, help="Log every exchange; passwords are masked.")
def command(  # noqa: PLR0913 - one for each option
    *,
    listen: str,
    password: str | None,
    data: Path | None,
    programs: Path | None,
    serial: str | None,
    readings: tuple[str, ...],
    time_scale: float,
    mutant: str | None,
    fault: str | None,
    control: bool,
    ready_file: Path | None,
    verbose: bool,
) -> None:
    """Run the virtual controller until it is stopped or receives a shutdown."""
    if mutant is not None and fault is not None:
        raise Problem("--fault is the old name of --mutant: give only --mutant")
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING, format="%(asctime)s %(message)s"
    )
    try:
        options = _Options(
            *split_host_port(listen, lowest_port=0),
            time_scale=time_scale,
            serial=_serial(serial),
            control=control,
            ready_file=ready_file,
        )
        dialect = Dialect.parse(readings)
        store = _store(password, data, programs)
    except (LinkError, ReadingError, StoreError) as error:
        raise Problem(sentence_of(error)) from None
    now = datetime.now(UTC).replace(tzinfo=None)  # the robot's zone (A-4.5-1)
    make = _core(fault if mutant is None else mutant)
    core = make(Plant(now, now_s=0.0), store, dialect, _log if verbose else _pass)
    asyncio.run(_serve(core, options))


def _core(mutant_id: str | None) -> type[ControllerCore]:
    if mutant_id is None:
        return ControllerCore
    known = mutants()
    if mutant_id not in known:
        raise no_such_mutant(mutant_id, known, "controller")
    return known[mutant_id].wrong


def _serial(text: str | None) -> Serial | None:
    """Return the device that a path or a link URL names."""
    if text is None:
        return None
    if "://" not in text:
        return Serial(text)
    address = parse(text)
    if not isinstance(address, Serial):
        raise Problem(UserMessage("--serial takes a serial device, not {text!r}", text=text))
    return address


def _store(password: str | None, data: Path | None, programs: Path | None) -> Store:
    store = Store() if data is None else DirectoryStore(data)
    if programs is not None:
        import_programs(store, programs)
    if password is not None:
        secret = os.fsencode(password)
        if not 1 <= len(secret) <= PASSWORD_MAX_BYTES or b"|" in secret:
            raise Problem(
                UserMessage(
                    "--password takes 1 to {password_max_bytes} bytes without '|'",
                    password_max_bytes=PASSWORD_MAX_BYTES,
                )
            )
        store.save(replace(store.settings, password=secret))
    return store


def _log(connection: int, seen: StreamItem) -> None:
    _logger.info(format_line(connection, seen))


def _pass(connection: int, seen: StreamItem) -> None:
    """Ignore a frame or invalid bytes: nothing is logged."""


async def _serve(core: ControllerCore, options: _Options) -> None:
    server = Server(core, options.time_scale)
    on_ending_signals(asyncio.get_running_loop(), lambda _: server.stop())
    try:
        await _begin(server, options)
        await server.stopped.wait()
    finally:
        await server.close()


async def _begin(server: Server, options: _Options) -> None:
    if options.ready_file is not None:
        with _writing(options.ready_file):
            options.ready_file.unlink(missing_ok=True)  # a file of an earlier run is outdated
    try:
        host, port = await server.listen(options.host, options.port)
    except (OSError, UnicodeError) as error:
        where = join_host_port(options.host, options.port)
        raise Problem(
            UserMessage(
                "cannot listen on {where}: {error}; choose another --listen, port 0 for any",
                where=where,
                error=_reason(error),
            )
        ) from None
    if options.serial is not None:
        try:
            SerialPort(server, *options.serial)
        except SerialPortError as error:
            raise Problem(sentence_of(error)) from None
    if options.control:
        Console(server, sys.stdin.fileno(), lambda text: click.echo(localized(text)))
    where = join_host_port(host, port)
    if options.ready_file is not None:
        _announce(options.ready_file, where)
    click.echo(localized("listening on {url}", url=f"tcp://{where}"))


def _reason(error: OSError | UnicodeError) -> str:
    """Return the reason without the address that asyncio repeats."""
    if isinstance(error, socket.gaierror) or not isinstance(error, OSError):
        return "the host name is unknown"
    # Python 3.13 tries all addresses of a name and gives no number if none is available.
    return os.strerror(error.errno or errno.EADDRNOTAVAIL)


def _announce(ready_file: Path, where: str) -> None:
    """Write the file atomically."""
    with _writing(ready_file):
        temporary = ready_file.with_name(f".{ready_file.name}.{os.getpid()}")
        temporary.write_text(f"{where}\n")
        temporary.replace(ready_file)


@contextlib.contextmanager
def _writing(ready_file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise Problem(
            UserMessage(
                "--ready-file {ready_file} cannot be written: {strerror}",
                ready_file=ready_file,
                strerror=error.strerror,
            )
        ) from None
