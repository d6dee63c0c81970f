"""Scheduling with pytest-xdist: all tests that use the controller run on one worker."""

import json
from pathlib import Path
from typing import Any, Final

import pytest
from xdist.scheduler import (  # type: ignore[import-untyped] # it has no types
    LoadFileScheduling,
    LoadGroupScheduling,
    LoadScopeScheduling,
)

_BY_MODE: Final = {"loadfile": LoadFileScheduling, "loadscope": LoadScopeScheduling}
_GROUP: Final = "scaraspec"


def scheduler(config: pytest.Config, log: Any, group: Path) -> Any:
    """Return a scheduler that keeps a group of tests together, whatever mode the team has chosen.

    The modes ``load`` and ``worksteal`` become ``loadgroup``, which distributes other tests in a
    similar way.

    Args:
        config: The configuration of the main process.
        log: The log of pytest-xdist.
        group: The file in which the workers list the tests of the group.

    Raises:
        pytest.UsageError: Every worker would run the cases.
    """
    mode = config.getoption("dist")
    if mode == "each":
        raise pytest.UsageError("--dist each would run the cases of scaraspec several times")
    chosen: Any = _BY_MODE.get(mode, LoadGroupScheduling)

    class Together(chosen):  # type: ignore[misc] # the class depends on the mode
        def _split_scope(self, nodeid: str) -> str:
            scope: str = super()._split_scope(nodeid)
            return _GROUP if nodeid in members else scope

        def schedule(self) -> None:
            members.update(json.loads(group.read_text("utf-8")))
            super().schedule()

    members = set[str]()
    return Together(config, log)
