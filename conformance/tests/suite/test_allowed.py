"""Only allowed requests are sent, and every case declares the hazards that it needs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scaraspec.cli.data import sample_program
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot, certified, hooks_of
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.state.recovery import RecoveryError
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

STORED = b"stored.rob"
HAZARDS = {command.name: command.hazard for command in BY_OPCODE.values()}


class RecordsCommands(ControllerCore):
    """Has a stored program and records the commands of all requests."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if STORED not in self.store:
            self.store.write(STORED, sample_program("pick-and-place.rob").read_bytes())
        self.inbox: set[str] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode in BY_OPCODE:
            self.inbox.add(BY_OPCODE[frame.opcode].name)
        super().handle(session, frame, now_s)


@pytest.mark.parametrize(
    "allowed",
    [
        pytest.param({Hazard.READ_ONLY}, id="nothing"),
        pytest.param(ALL - {Hazard.STATE}, id="no-state"),
        pytest.param(ALL - {Hazard.MOTION}, id="no-motion", marks=pytest.mark.runs),
        pytest.param(ALL - {Hazard.DESTRUCTIVE}, id="nothing-destructive", marks=pytest.mark.runs),
    ],
)
def test_only_allowed_commands_are_sent(allowed: frozenset[Hazard]) -> None:
    """The exceptions are logins and the deletion of the suite's own files."""
    cores: list[RecordsCommands] = []

    def make(*args: Any, **kwargs: Any) -> ControllerCore:
        cores.append(RecordsCommands(*args, **kwargs))
        return cores[-1]

    robot = Robot(make, DEFAULT)  # type: ignore[arg-type] # it only calls it
    options = Options(allowed=frozenset(allowed), examples=1)
    cases = certified(robot, Ics(hooks=hooks_of(robot)), options).cases
    problems = (Verdict.ERROR, Verdict.FAIL, Verdict.INCONCLUSIVE)
    assert [f"{case.id}: {case.message}" for case in cases if case.verdict in problems] == []
    received = set().union(*(core.inbox for core in cores))
    own = {"login"} | ({"delete_program"} if Hazard.STATE in allowed else set())
    assert {name for name in received if HAZARDS[name] not in allowed} <= own
    assert cores[-1].store.names() == [STORED]


def test_recovery_waits_until_it_is_allowed(tmp_path: Path) -> None:
    """A run that may not restore the settings reports an error and keeps the journal."""
    robot = Robot(ControllerCore, DEFAULT)
    file = tmp_path / "journal"
    killed = Journal(file)
    killed.begin("2026-01-01", {"gripper centre": [1.0, 2.0, 3.0], "outputs": "1000000000000000"})
    killed.write("changing", setting="gripper centre")
    killed.write("changing", setting="outputs")
    killed.close()
    options = Options(only=frozenset({"4.8/2"}))
    for allowed in (options.allowed, ALL - {Hazard.MOTION}):
        with pytest.raises(RecoveryError, match=r"--allow .*motion"):
            Run(_adapter(robot, replace(options, allowed=allowed), Journal(file))).results()
    results = Run(_adapter(robot, replace(options, allowed=ALL), Journal(file))).results()
    assert results.verdict.good
    assert "the outputs was 0000000000000000" in results.notices[0]
    assert not file.exists()


def _adapter(robot: Robot, options: Options, journal: Journal) -> ControllerAdapter:
    access = MemoryAccess(robot.network)
    return ControllerAdapter(access, Ics(), PASSWORD, options, journal=journal)
