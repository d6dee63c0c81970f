"""`scaraspec requirements --entry`."""

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from scaraspec.cli.main import group
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.rules import RULES
from scaraspec.register import register

PACKAGES = Path(__file__).parents[2]
PLACE = re.compile(r"(scaraspec/[\w/]+\.py):(\d+)")


def entry(name: str) -> dict[str, Any]:
    """Return the fields of a requirement or register entry."""
    shown = CliRunner().invoke(group, ["requirements", "--entry", name, "--json"])
    assert shown.exit_code == 0, (name, shown.exception)
    fields: dict[str, Any] = json.loads(shown.output)
    return fields


def test_each_requirement() -> None:
    """Each rule, case and mutant of a requirement has a file and a line that exist."""
    lengths: dict[str, int] = {}
    for name in REQUIREMENTS:
        fields = entry(name)
        assert len(fields["rules"]) == sum(rule.requirement == name for rule in RULES)
        for place in (*fields["rules"], *fields["cases"], *fields["mutants"]):
            found = PLACE.match(place)
            assert found, place
            file, line = found.groups()
            if file not in lengths:
                lengths[file] = len((PACKAGES / file).read_text("utf-8").splitlines())
            assert 1 <= int(line) <= lengths[file], place


def test_each_register_entry() -> None:
    """Each entry of the register is shown."""
    for name in register():
        assert entry(name)["id"] == name


def test_rule_with_arguments() -> None:
    """The place of a rule that is registered in a loop is that of its function."""
    rule = next(rule for rule in RULES if isinstance(rule.check, partial))
    assert isinstance(rule.check, partial)
    function = rule.check.func
    (file, line), *_ = (PLACE.findall(place)[0] for place in entry(rule.requirement)["rules"])
    text = (PACKAGES / file).read_text("utf-8").splitlines()
    assert function.__name__ in "".join(text[int(line) - 1 : int(line) + 2])


def test_cases() -> None:
    """A case has its place, id and sentence."""
    (again,) = (case for case in entry("4.17/3")["cases"] if ": 4.17/3.again: " in case)
    assert again.startswith("scaraspec/suite/controller/cases/test_4_17_emergency_stop.py:")
    assert again.endswith("each run starts from the beginning.")


def test_unknown_entry() -> None:
    """An unknown id is an error."""
    shown = CliRunner().invoke(group, ["requirements", "--entry", "4.99/1"])
    assert "register entries have ids such as A-3-14" in str(shown.exception)
