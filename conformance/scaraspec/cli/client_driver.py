"""`scaraspec client-driver`: the reference client, for a tester that plays the controller."""

import asyncio

import click

from scaraspec.cli.options import Real
from scaraspec.cli.problems import Problem
from scaraspec.client.aio import AsyncClient
from scaraspec.client.driver import serve
from scaraspec.protocol.readings import Dialect, ReadingError

EXAMPLE = "Example: scaraspec certify client --driver 'scaraspec client-driver'"


@click.command(epilog=EXAMPLE)
@click.option(
    "--transfer-timeout",
    type=Real(0.1, 3600),
    metavar="S",
    help="Give a transfer up after this silence [30].",
)
@click.option("--reply-timeout", type=Real(0.1, 3600), metavar="S", help="Wait for replies [5].")
@click.option(
    "--reading", "readings", multiple=True, metavar="KEY=OPTION", help="Speak so; repeatable."
)
def command(
    *, transfer_timeout: float | None, reply_timeout: float | None, readings: tuple[str, ...]
) -> None:
    """Drive the reference client by JSON Lines on stdin and stdout, until stdin ends."""
    try:
        dialect = Dialect.parse(readings)
    except ReadingError as error:
        raise Problem(str(error)) from None
    times = {"xfer_timeout": transfer_timeout, "reply_timeout": reply_timeout}
    dialect = dialect.replace(**{key: f"{s:g}" for key, s in times.items() if s is not None})
    asyncio.run(serve(lambda url, password: AsyncClient(url, password=password, dialect=dialect)))
