"""The options of the pytest plugin, read as the command line reads its own."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

import click
import pytest

from scaraspec.cli.certify.controller import command
from scaraspec.cli.certify.controller_run import Settings
from scaraspec.cli.certify.preparation import user_errors
from scaraspec.cli.problems import Problem
from scaraspec.cli.vocabulary import WORDS
from scaraspec.suite.engine.ics import Ics
from scaraspec.transports.url import parse
from scaraspec.user_message import sentence_of

PREFIX: Final = "--scaraspec-"
_OPTION: Final = re.compile(r"(?<![\w-])--(?=[a-z])")


class Given(NamedTuple):
    """What the options of a session say.

    Attributes:
        context: The context of ``certify controller`` with the same options.
        settings: Its parameters.
        url: The controller; empty if none is named.
        statement: The claims of the controller.
    """

    context: click.Context
    settings: Settings
    url: str
    statement: Ics


def read(config: pytest.Config) -> Given:
    """Read the options of a session.

    Raises:
        pytest.UsageError: An option is wrong.
    """
    url = config.getoption(f"{PREFIX}subject") or ""
    with usage_errors():
        context = command.make_context("controller", [*_words(config), *filter(None, [url])])
        settings = Settings(**context.params)
        statement = settings.read_statement()
        url = url or statement.url
        if url:
            parse(url)
    return Given(context, settings, url, statement)


@contextmanager
def usage_errors() -> Iterator[None]:
    """Turn errors of the command line into usage errors of pytest, with the prefixed options."""
    try:
        with user_errors():
            yield
    except click.ClickException as error:
        raise _prefixed(error.format_message()) from None
    except Problem as error:
        raise _prefixed(sentence_of(error)) from None


def _prefixed(message: str) -> pytest.UsageError:
    return pytest.UsageError(_OPTION.sub(PREFIX, message))


def _words(config: pytest.Config) -> Iterator[str]:
    """Yield the options as words of the command line."""
    for word in WORDS.values():
        value = config.getoption(f"{PREFIX}{word.name}")
        if word.metavar is None:
            if value:
                yield f"--{word.name}"
        elif value is not None:
            yield f"--{word.name}={value}"
