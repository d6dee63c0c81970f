"""What several commands take from their user, said once."""

import math
from typing import Any, Final

import click

from scaraspec.protocol.port import DEFAULT_PORT

DEFAULT_PASSWORD: Final = "password"  # noqa: S105 - the document's own (L109)


class Real(click.FloatRange):
    """A number of a range, in which NaN is not."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is no number.", param, ctx)
        return number


capture_port: Final = click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_PORT,
    show_default=True,
    callback=lambda _context, _option, port: port or None,
    help="The controller's TCP port in a pcap; 0 for any.",
)
"""Which connections of a packet capture are read; None where any are."""
