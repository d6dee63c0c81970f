"""All tests that use the controller are one unit in every mode of pytest-xdist."""

import json
from pathlib import Path
from typing import Any, cast

import pytest
from xdist.scheduler import LoadScopeScheduling  # type: ignore[import-untyped] # it has no types

from scaraspec.pytest_plugin.scheduling import scheduler

CASES = ["scaraspec/test_a.py::test_a", "scaraspec/test_b.py::test_b", "own/test_c.py::test_c"]
OWN = ["own/test_c.py::test_d", "own/test_c.py::test_e"]


class Session:
    """The configuration of a session with this mode."""

    def __init__(self, mode: str) -> None:
        self._mode = mode

    def getoption(self, _name: str) -> str:
        return self._mode

    def getvalue(self, _name: str) -> list[str]:
        return ["popen"]


def _scheduler(mode: str, group: Path) -> Any:
    return scheduler(cast("pytest.Config", Session(mode)), None, group)


@pytest.mark.parametrize(
    ("mode", "units"),
    [("load", 3), ("worksteal", 3), ("loadgroup", 3), ("loadscope", 2), ("loadfile", 2)],
)
def test_one_unit(mode: str, units: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The group is one unit; the mode decides about the other tests."""
    group = tmp_path / "group.json"
    group.write_text(json.dumps(CASES), "utf-8")
    monkeypatch.setattr(LoadScopeScheduling, "schedule", lambda _self: None)
    made = _scheduler(mode, group)
    made.schedule()
    scopes = [made._split_scope(name) for name in CASES + OWN]
    assert len(set(scopes[:3])) == 1
    assert len(set(scopes)) == units


def test_every_worker(tmp_path: Path) -> None:
    """The mode in which each worker runs all tests is refused."""
    with pytest.raises(pytest.UsageError, match="several times"):
        _scheduler("each", tmp_path)
