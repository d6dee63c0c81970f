"""Nothing is sent that the tester has not allowed, and every case says what it needs to send."""

from pathlib import Path
from typing import Any

import pytest

from scaraspec.cli.data import sample_program
from scaraspec.cli.prove.controller import PASSWORD, Robot, certified, hooks_of
from scaraspec.controller.brain import Brain
from scaraspec.controller.session import Session
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.as_client.access import MemoryAccess
from scaraspec.suite.as_client.setting import ControllerSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement

STORED = b"stored.rob"
HAZARDS = {command.name: command.hazard for command in BY_OPCODE.values()}


class Hears(Brain):
    """Has a program, as robots have, and keeps what it is asked."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if STORED not in self.store:
            self.store.write(STORED, sample_program("pick-and-place.rob").read_bytes())
        self.heard: set[str] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Keep the command."""
        if frame.opcode in BY_OPCODE:
            self.heard.add(BY_OPCODE[frame.opcode].name)
        super().handle(session, frame, now_s)


@pytest.mark.parametrize(
    "allowed",
    [
        {Hazard.READ_ONLY},
        ALL - {Hazard.STATE},
        ALL - {Hazard.MOTION},
        ALL - {Hazard.DESTRUCTIVE},
    ],
    ids=["nothing", "no-state", "no-motion", "nothing-destructive"],
)
def test_nothing_else_is_sent(allowed: frozenset[Hazard]) -> None:
    """But for logins, and for the suite's own files, which it takes away again."""
    brains: list[Hears] = []

    def make(*args: Any, **kwargs: Any) -> Brain:
        brains.append(Hears(*args, **kwargs))
        return brains[-1]

    robot = Robot(make, DEFAULT)  # type: ignore[arg-type] # it only calls it
    options = Options(allowed=frozenset(allowed), examples=1)
    cases = certified(robot, Statement(hooks=hooks_of(robot)), options).cases
    bad = (Verdict.ERROR, Verdict.FAIL, Verdict.INCONCLUSIVE)
    assert [f"{case.id}: {case.message}" for case in cases if case.verdict in bad] == []
    heard = set().union(*(brain.heard for brain in brains))
    own = {"login"} | ({"delete_program"} if Hazard.STATE in allowed else set())
    assert {name for name in heard if HAZARDS[name] not in allowed} <= own
    assert brains[-1].store.names() == [STORED]


def test_what_a_killed_run_has_left_is_not_forgotten(tmp_path: Path) -> None:
    """A run that may not put it back says so, and leaves its file to one that may."""
    robot = Robot(Brain, DEFAULT)
    file = tmp_path / "state.json"
    file.write_text('{"outputs": "1000000000000000", "gripper centre": [1.0, 2.0, 3.0]}')
    for allowed, told in ((Options().allowed, 2), (ALL - {Hazard.MOTION}, 1), (ALL, 0)):
        options = Options(only=frozenset({"4.8/2"}), allowed=allowed)
        access = MemoryAccess(robot.network)
        setting = ControllerSetting(access, Statement(), PASSWORD, options, state_file=file)
        cases = Run(setting).results().cases
        wanting = [case.message for case in cases if "it wants --allow" in case.message]
        assert sum(message.count("it wants --allow") for message in wanting) == told
        assert file.exists() is bool(told)
