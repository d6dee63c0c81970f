"""Help texts with headings, for commands with many options."""

from collections.abc import Mapping, Sequence
from typing import Any

import click


class GroupedCommand(click.Command):
    """A command whose help shows options under headings.

    Args:
        groups: Names of parameters by heading, in the order of the help.
        arguments: The arguments of `click.Command`.
    """

    def __init__(self, *, groups: Mapping[str, Sequence[str]], **arguments: Any) -> None:
        super().__init__(**arguments)
        self._groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings, and the others at the end."""
        records = {
            parameter.name: record
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option) and (record := parameter.get_help_record(ctx))
        }
        for heading, names in self._groups.items():
            with formatter.section(heading):
                formatter.write_dl([records.pop(name) for name in names])
        formatter.write_paragraph()
        formatter.write_dl(list(records.values()))
