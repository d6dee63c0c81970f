"""Options that several commands share."""

import math
from collections.abc import Callable, Collection, Iterator
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, Final, TypeVar

import click
from click.core import ParameterSource

from scaraspec.cli.vocabulary import PASSWORD_SOURCE
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.tables.files import utc_text
from scaraspec.translation import VARIABLE, Language, localized, set_display_language
from scaraspec.user_message import UserMessage
from scaraspec_recorder.units import SECOND_NS, QuantityError, parse_duration

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)

F = TypeVar("F", bound=Callable[..., Any])


class Real(click.FloatRange):
    """A number in a range. NaN is not permitted."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text to a number."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(localized("{value!r} is not a number.", value=value), param, ctx)
        return number


class Duration(click.ParamType[float]):
    """A duration such as ``500ms``, ``60s``, ``10m`` or ``1h``; its value is in seconds."""

    name = "duration"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Convert the text to seconds."""
        if isinstance(value, float):
            return value
        try:
            return parse_duration(value) / SECOND_NS
        except QuantityError as error:
            self.fail(localized("{error}.", error=error), param, ctx)

    def to_text(self, value: float) -> str:
        """Return the text of a value."""
        return f"{value:g}s"


class Instant(click.ParamType[int]):
    """A time such as ``2026-11-21T08:15:30.5`` (UTC) or Unix seconds; its value is in ns."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Convert the text to nanoseconds since the Unix epoch."""
        if isinstance(value, int):
            return value
        try:
            return int(Decimal(value) * SECOND_NS)
        except (InvalidOperation, ValueError, OverflowError):
            pass
        try:
            instant = datetime.fromisoformat(value)
            since = instant.replace(tzinfo=instant.tzinfo or UTC) - _EPOCH
            return since // timedelta(microseconds=1) * 1000
        except (ValueError, OverflowError):
            message = UserMessage(
                "{text!r} is not a time: write 2026-11-21T08:15:30.5, or Unix seconds.", text=value
            )
            self.fail(localized(message), param, ctx)

    def to_text(self, value: int) -> str:
        """Return the text of a value."""
        return utc_text(value)


class Percentage(click.ParamType[float]):
    """A percentage such as ``95%``; its value is between 0 and 100."""

    name = "percentage"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Convert the text to a number."""
        if isinstance(value, float):
            return value
        try:
            percent = float(value.removesuffix("%"))
        except ValueError:
            percent = math.nan
        if not 0 <= percent <= 100:  # noqa: PLR2004 - percent
            self.fail(localized("{value!r} is not a percentage.", value=value), param, ctx)
        return percent


def password_option(default: str | None, text: str) -> Callable[[F], F]:
    """Return the option ``--password``, which can also be set by an environment variable.

    Args:
        default: The password if neither the option nor the variable is set.
        text: Its help text.
    """
    return click.option(
        "--password",
        envvar="SCARASPEC_PASSWORD",
        default=default,
        metavar="PASSWORD",
        help=f"{text} {PASSWORD_SOURCE}.",
    )


state_dir_option = click.option(
    "--state-dir",
    type=click.Path(path_type=Path),
    envvar="SCARASPEC_STATE",
    metavar="DIR",
    help="Folder of the journals [SCARASPEC_STATE, or the user's state directory].",
)
"""The option ``--state-dir``, which can also be set by an environment variable."""


def given_options(
    context: click.Context, *, without: Collection[str], always: Collection[str] = ()
) -> Iterator[str]:
    """Yield the words of the options that were given, to repeat a command.

    Args:
        context: The context of the command.
        without: Parameters that are not repeated.
        always: Parameters that are repeated even if they have their default.
    """
    for option in context.command.params:
        name = option.name or ""
        if not isinstance(option, click.Option) or name in without or not option.expose_value:
            continue
        given = context.get_parameter_source(name) is not ParameterSource.DEFAULT
        value = context.params[name]
        if option.is_flag:
            if value:
                yield option.opts[-1]
        elif (given and value is not None) or name in always:
            for each in value if option.multiple else (value,):
                to_text = getattr(option.type, "to_text", str)
                yield from (option.opts[-1], to_text(each))


class CommandNames(click.ParamType[frozenset[str]]):
    """Names of commands, separated by commas; undefined opcodes as ``0x13``."""

    name = "list"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> frozenset[str]:
        """Convert the text to the set of names."""
        if isinstance(value, frozenset):
            return value
        names = frozenset(value.split(","))
        for name in sorted(names - BY_NAME.keys()):
            if not name.startswith("0x"):
                message = UserMessage(
                    "{name!r} is not a command: see scaraspec call --help.", name=name
                )
                self.fail(localized(message), param, ctx)
        return names

    def to_text(self, value: frozenset[str]) -> str:
        """Return the text of a value."""
        return ",".join(sorted(value))


def selection_options(command: F) -> F:
    """Add the options that select a part of a capture."""
    for option in (
        click.option(
            "--command",
            "commands",
            type=CommandNames(),
            default=frozenset(),
            metavar="LIST",
            help="Only these commands: run_program,get_status.",
        ),
        click.option("--connection", help="Only this connection."),
        click.option("--until", type=Instant(), help="Only before this time."),
        click.option(
            "--since", type=Instant(), help="Only from this time on: 2026-11-21T08:15 (UTC)."
        ),
    ):
        command = option(command)
    return command


capture_port: Final = click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_PORT,
    show_default=True,
    callback=lambda _context, _option, port: port or None,
    help="The controller's TCP port in a pcap. 0, or no connection on the default port: every "
    "connection of this protocol.",
)
"""The port of the connections to read in a packet capture; None for all of this protocol."""


def _use_language(_context: click.Context, _option: click.Parameter, language: str | None) -> None:
    if language:
        set_display_language(Language(language))


language_option = click.option(
    "--language",
    type=click.Choice([each.value for each in Language]),
    is_eager=True,
    expose_value=False,
    callback=_use_language,
    help=f"Language of messages and pages [{VARIABLE}, or that of the locale].",
)
"""The option ``--language``, which sets the display language."""
