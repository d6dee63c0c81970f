"""Public names do not change: `public_names.json` and the published kill matrices list them.

A name may be added. To remove or rename one, keep an alias for one release and add a line to
CHANGELOG.md.
"""

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from mcap.reader import make_reader

from scaraspec import pytest_plugin
from scaraspec.cli.main import COMMANDS, group
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.mutants import client, controller
from scaraspec.suite.engine.hooks import HOOKS
from scaraspec.suite.engine.ics import Motion
from scaraspec.transports.url import parse
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink

NAMES = json.loads(Path(__file__).with_name("public_names.json").read_text("utf-8"))
ROOT = Path(__file__).parents[2]


def _options(command: click.Command, path: str) -> Iterator[tuple[str, list[str]]]:
    context = click.Context(command, info_name=path)
    named = [name for parameter in command.params for name in parameter.opts]
    yield path, [name for name in named if name.startswith("-")]
    if isinstance(command, click.Group):
        for part in command.list_commands(context):
            below = command.get_command(context, part)
            assert below
            yield from _options(below, f"{path} {part}")


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_and_options(command: str) -> None:
    """Each published command and option exists."""
    found = group.get_command(click.Context(group), command)
    assert found
    options = dict(_options(found, command))
    published = {k: v for k, v in NAMES["options"].items() if k.split()[0] == command}
    assert published
    for path, names in published.items():
        assert set(names) <= set(options[path]), path


def test_exit_statuses() -> None:
    """Scripts compare with these numbers."""
    assert {status.name.lower(): int(status) for status in ExitStatus} == NAMES["exit_statuses"]


def test_ics_keys() -> None:
    """ICS files of users have these keys."""
    assert set(NAMES["ics_hooks"]) <= set(HOOKS)
    assert set(NAMES["ics_motion"]) <= set(Motion.__dataclass_fields__)


def test_pytest_options(pytestconfig: pytest.Config) -> None:
    """Users pass these to pytest."""
    options = vars(pytestconfig.option)
    assert all(name[2:].replace("-", "_") in options for name in NAMES["pytest_options"])


def test_pytest_fixtures(pytestconfig: pytest.Config) -> None:
    """Tests of users request these, and users select the cases by this mark."""
    assert all(hasattr(pytest_plugin, name) for name in NAMES["pytest_fixtures"])
    marks = pytestconfig.getini("markers")
    assert any(line.startswith(f"{NAMES['pytest_mark']}(") for line in marks)


def test_mcap_topics() -> None:
    """Programs that read recordings use these topics."""
    file = io.BytesIO()
    file.close = lambda: None  # type: ignore[method-assign] # read after the sink closed it
    sink = McapSink(file, {})
    sink.close({})
    file.seek(0)
    summary = make_reader(file).get_summary()
    assert summary
    assert set(NAMES["mcap_topics"]) <= {c.topic for c in summary.channels.values()}


@pytest.mark.parametrize("url", NAMES["links"])
def test_links(url: str) -> None:
    """These forms of a link can be read."""
    assert parse(url)


@pytest.mark.parametrize(("role", "mutants"), [("controller", controller), ("client", client)])
def test_mutant_ids(role: str, mutants: Any) -> None:
    """The published kill matrix names the mutants by these ids."""
    matrix = json.loads((ROOT / f"reports/kill-matrix.{role}.json").read_text("utf-8"))
    assert {entry["fault"] for entry in matrix["faults"]} == set(mutants.mutants())
