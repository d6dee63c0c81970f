"""Help texts: options under headings, and help in the display language."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from inspect import cleandoc
from typing import Any, Final, TypeVar

import click
from click.formatting import iter_rows, measure_table
from rich.cells import cell_len

from scaraspec.translation import Language, display_language, localized

C = TypeVar("C", bound=click.Command)

_EXAMPLE: Final = "Example: "
_UNITS: Final = re.compile(
    r"\s*(?:[（《“\[(]*[\u2e80-\uffef][，。；：、）》”]*|[^\s\u2e80-\uffef]+)"
)
"""What a line is never broken in: a Latin word, or a Chinese character with its punctuation."""


class GroupedCommand(click.Command):
    """A command whose help shows options under headings.

    Args:
        groups: Names of parameters by heading, in the order of the help.
        arguments: The arguments of `click.Command`.
    """

    def __init__(self, *, groups: Mapping[str, Sequence[str]], **arguments: Any) -> None:
        super().__init__(**arguments)
        self.groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings, and the others at the end."""
        records = {
            parameter.name: record
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option) and (record := parameter.get_help_record(ctx))
        }
        for heading, names in self.groups.items():
            with formatter.section(localized(heading)):
                formatter.write_dl([records.pop(name) for name in names])
        formatter.write_paragraph()
        formatter.write_dl(list(records.values()))


class LocalizedContext(click.Context):
    """A context whose help is in the display language, and is wrapped as this language needs it.

    The help is translated when it is printed, because an option of the command itself may select
    the language.
    """

    def get_help(self) -> str:
        """Return the help of the command."""
        option = self.command.get_help_option(self)
        if option:  # click has translated it when it read the command line
            option.help = localized("Show this message and exit.")
        return in_display_language(self.command).get_help(self)

    def make_formatter(self) -> click.HelpFormatter:
        """Return the formatter of the help."""
        english = super().make_formatter()
        if display_language() is Language.ENGLISH:
            return english
        return _ChineseFormatter(width=english.width)


class _ChineseFormatter(click.HelpFormatter):
    """Breaks lines between Chinese characters, which take two columns each."""

    def write_heading(self, heading: str) -> None:
        self.write(f"{'':{self.current_indent}}{heading}：\n")

    def write_text(self, text: str) -> None:
        super().write_text(_wrapped(text, self.width - self.current_indent))

    def write_dl(
        self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2
    ) -> None:
        rows = list(rows)
        width = self.width - min(measure_table(rows)[0], col_max) - col_spacing - 2
        wrapped = [(first, _wrapped(second, width)) for first, second in iter_rows(rows, 2)]
        super().write_dl(wrapped, col_max, col_spacing)


def _wrapped(text: str, width: int) -> str:
    """Return a text with line breaks, and with the marks by which click keeps them."""
    return "\n\n".join(
        paragraph if paragraph.startswith("\b") else "\b\n" + "\n".join(_lines(paragraph, width))
        for paragraph in text.split("\n\n")
    )


def _lines(paragraph: str, width: int) -> Iterator[str]:
    line = ""
    for unit in _UNITS.findall(paragraph):
        if cell_len(line + unit) > width and line:
            yield line
            line = unit.lstrip()
        else:
            line += unit
    yield line


def normalized(text: str) -> str:
    """Return a help text without line breaks in its paragraphs, except in preformatted ones."""
    paragraphs = cleandoc(text).split("\n\n")
    return "\n\n".join(p if p.startswith("\b") else " ".join(p.split()) for p in paragraphs)


def texts_of(command: click.Command) -> Iterator[str]:
    """Yield the texts of a command's help that are translated."""
    for text in (command.help, command.epilog):
        if text and not text.startswith(_EXAMPLE):
            yield normalized(text)
    if isinstance(command, GroupedCommand):
        yield from command.groups
    for option in command.params:
        if isinstance(option, click.Option) and option.help:
            yield normalized(option.help)


def with_localized_help(command: C) -> C:
    """Make a command and those below it show their help in the display language."""
    command.context_class = LocalizedContext
    if isinstance(command, click.Group):
        for below in command.commands.values():
            with_localized_help(below)
    return command


def in_display_language(command: C) -> C:
    """Return a command with its help texts in the display language."""
    if display_language() is Language.ENGLISH:
        return command
    translated = copy(command)
    translated.help, translated.epilog = _translated(command.help), _translated(command.epilog)
    translated.short_help = _translated(command.short_help)
    translated.params = [_translated_option(parameter) for parameter in command.params]
    if isinstance(translated, click.Group):
        translated.commands = {
            name: in_display_language(below) for name, below in translated.commands.items()
        }
    return translated


def _translated_option(parameter: click.Parameter) -> click.Parameter:
    translated = copy(parameter)
    if isinstance(translated, click.Option):
        translated.help = _translated(translated.help)
    return translated


def _translated(text: str | None) -> str | None:
    if not text:
        return text
    if text.startswith(_EXAMPLE):
        return localized("Example: {command}", command=text.removeprefix(_EXAMPLE))
    return localized(normalized(text))
