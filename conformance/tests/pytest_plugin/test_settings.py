"""The options of the plugin equal those of the command line."""

from typing import Any, cast

import click
import pytest

from scaraspec.cli.certify.controller import command
from scaraspec.cli.certify.controller_run import Settings
from scaraspec.cli.vocabulary import WORDS
from scaraspec.pytest_plugin.settings import read

URL = "tcp://192.168.1.2"


class GivenOptions:
    """The configuration of a session with these options."""

    def __init__(self, **options: Any) -> None:
        self._options = {"--scaraspec-subject": URL, **options}

    def getoption(self, name: str) -> Any:
        return self._options.get(name)


def _read(**options: Any) -> Any:
    return read(cast("pytest.Config", GivenOptions(**options)))


def test_same_options() -> None:
    """Each option of the command exists, except those of features that pytest does not have."""
    names = {max(o.opts, key=len)[2:] for o in command.params if isinstance(o, click.Option)}
    only_there = {"attended", "certification", "dry-run", "package", "rerun-from"}
    assert names - set(WORDS) == only_there
    assert set(WORDS) <= names


def test_same_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without options everything is as on the command line, also the password from the
    environment."""
    monkeypatch.setenv("SCARASPEC_PASSWORD", "secret")
    given = _read()
    assert given.settings == Settings(**command.make_context("controller", [URL]).params)
    assert (given.url, given.settings.password) == (URL, "secret")


def test_values(tmp_path: Any) -> None:
    """Values and flags are converted as on the command line; the ICS names the controller."""
    ics = tmp_path / "ics.toml"
    ics.write_text(f'[subject]\nurl = "{URL}"\n', "utf-8")
    options = {"--scaraspec-wait-for": "2m", "--scaraspec-exhaustive": True}
    given = _read(**options, **{"--scaraspec-ics": f"{ics}", "--scaraspec-subject": None})
    assert (given.url, given.settings.wait_for, given.settings.exhaustive) == (URL, 120.0, True)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--scaraspec-examples", "0", "Invalid value for '--scaraspec-examples'"),
        ("--scaraspec-ics", "/nowhere.toml", "/nowhere.toml"),
        ("--scaraspec-subject", "ftp://host", "ftp://host"),
    ],
)
def test_errors(option: str, value: str, message: str) -> None:
    """An error names the option with its prefix."""
    with pytest.raises(pytest.UsageError, match=message):
        _read(**{option: value})
