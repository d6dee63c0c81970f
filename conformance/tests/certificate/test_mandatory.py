"""The lists of mandatory cases fit the collected cases and keep their history."""

import importlib.util
from dataclasses import replace
from datetime import date
from typing import Any

import pytest
from wording import ROOT

from scaraspec.certificate.mandatory import Change, list_folder, mandatory_lists
from scaraspec.report.model import Role

ROLES = pytest.mark.parametrize("role", [Role.CONTROLLER, Role.CLIENT])
LATER = date(2999, 1, 2)


@pytest.fixture(scope="module")
def script() -> Any:
    """Return the script that writes the lists."""
    found = importlib.util.spec_from_file_location("mandatory", ROOT / "spec/mandatory.py")
    assert found
    assert found.loader
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@ROLES
def test_the_newest_list_fits_the_code(script: Any, role: Role) -> None:
    """If cases were added, changed or removed, `make spec` writes a list with today's date."""
    assert script.renewed(role, LATER) is None


@ROLES
def test_each_file_is_a_list(role: Role) -> None:
    """The checksum is that of the file, and the file name is the id."""
    for each in mandatory_lists(role):
        assert (list_folder() / f"{each.id}.json").read_text("utf-8") == each.to_json()


def test_undefined_opcodes_are_optional() -> None:
    """No mandatory case sends opcodes that may move a robot in an unknown way."""
    newest = mandatory_lists(Role.CONTROLLER)[-1]
    assert "3/21" in newest.optional_cases
    assert newest.cases.keys().isdisjoint(newest.optional_cases)


def test_history(script: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A changed list contains the difference; the author names the repaired cases."""
    newest = mandatory_lists(Role.CONTROLLER)[-1]
    first, second, *_ = newest.cases
    cases = {"0/0": ("0/0",), **{k: v for k, v in newest.cases.items() if k != first}}
    earlier = replace(newest, id="controller-2025-01-01", cases=cases)
    monkeypatch.setattr(script, "mandatory_lists", lambda _: (earlier,))
    made = script.renewed(Role.CONTROLLER, LATER, [second])
    assert made is not None
    assert made.id == "controller-2999-01-02"
    assert made.history[-1] == Change("2999-01-02", (first,), (second,), ("0/0",))
    monkeypatch.setattr(script, "mandatory_lists", lambda _: (earlier, made))
    assert script.renewed(Role.CONTROLLER, date(2999, 3, 4)) is None
    again = script.renewed(Role.CONTROLLER, LATER, [first])
    assert again is not None
    assert again.history == (Change("2999-01-02", (first,), (first,), ("0/0",)),)
