"""What several commands take from their user, said once."""

import math
from collections.abc import Callable
from typing import Any, Final, TypeVar

import click

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.user_message import UserMessage
from scaraspec_recorder.quantities import SECOND_NS, QuantityError, parse_duration

F = TypeVar("F", bound=Callable[..., Any])

DEFAULT_PASSWORD: Final = "password"  # noqa: S105 - the document's own (L109)


class Real(click.FloatRange):
    """A number of a range, in which NaN is not."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(UserMessage("{value!r} is no number.", value=value), param, ctx)
        return number


class Duration(click.ParamType[float]):
    """A duration such as ``500ms``, ``60s``, ``10m`` or ``1h``; its value is in seconds."""

    name = "duration"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The seconds."""
        if isinstance(value, float):
            return value
        try:
            return parse_duration(value) / SECOND_NS
        except QuantityError as error:
            self.fail(UserMessage("{error}.", error=error), param, ctx)


def password_option(default: str | None, text: str) -> Callable[[F], F]:
    """The option ``--password``, which the environment can give, too.

    Args:
        default: The password where neither names one.
        text: Its help text.
    """
    return click.option(
        "--password",
        envvar="SCARASPEC_PASSWORD",
        default=default,
        metavar="PASSWORD",
        help=f"{text}; else SCARASPEC_PASSWORD, else '{DEFAULT_PASSWORD}'.",
    )


capture_port: Final = click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_PORT,
    show_default=True,
    callback=lambda _context, _option, port: port or None,
    help="The controller's TCP port in a pcap; 0 for any.",
)
"""Which connections of a packet capture are read; None where any are."""
