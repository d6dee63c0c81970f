"""`scaraspec client-driver`: the reference client as a driver for `certify client`."""

import asyncio
import sys

import click

from scaraspec.cli.options import Real
from scaraspec.cli.problems import Problem
from scaraspec.client.aio import AsyncClient
from scaraspec.client.driver import serve
from scaraspec.protocol.readings import Dialect, ReadingError
from scaraspec.user_message import sentence_of

EXAMPLE = "Example: scaraspec certify client --driver 'scaraspec client-driver'"


@click.command(epilog=EXAMPLE)
@click.option(
    "--transfer-timeout",
    type=Real(0.1, 3600),
    metavar="S",
    help="Abandon a transfer after this silence [30].",
)
@click.option(
    "--reply-timeout", type=Real(0.1, 3600), metavar="S", help="Time to wait for a reply [5]."
)
@click.option(
    "--reading",
    "readings",
    multiple=True,
    metavar="KEY=OPTION",
    help="Follow this reading; repeatable.",
)
def command(
    *, transfer_timeout: float | None, reply_timeout: float | None, readings: tuple[str, ...]
) -> None:
    """Run the reference client as a driver: JSON Lines on stdin and stdout, until stdin ends."""
    if sys.platform == "win32":
        raise Problem("client-driver runs on Linux and macOS only, as `certify client` does")
    try:
        dialect = Dialect.parse(readings)
    except ReadingError as error:
        raise Problem(sentence_of(error)) from None
    times = {"xfer_timeout": transfer_timeout, "reply_timeout": reply_timeout}
    dialect = dialect.replace(**{key: f"{s:g}" for key, s in times.items() if s is not None})
    asyncio.run(serve(lambda url, password: AsyncClient(url, password=password, dialect=dialect)))
