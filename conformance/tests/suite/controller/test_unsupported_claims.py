"""`lacks` in the ICS: the claim is tested, honoured by every case, and part of the verdict."""

from dataclasses import replace

import pytest

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.mutants.controller_run import Robot, certified, hooks_of
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore

CLAIMED = frozenset({"get_time", "jog"})


class WithoutClockQueryAndJog(ControllerCore):
    """Does not know two opcodes."""

    def _command(self, frame: Frame) -> Command | None:
        command = super()._command(frame)
        return None if command and command.name in CLAIMED else command


def run(core: type[ControllerCore], options: Options) -> Results:
    robot = Robot(core, DEFAULT)
    return certified(robot, Ics(unsupported=CLAIMED, hooks=hooks_of(robot)), options)


def test_a_true_claim() -> None:
    """No case sends the commands, and the verdict says that they are missing."""
    only = frozenset(each.id for each in select("2,4.5,4.6,4.8,4.17,4.28"))
    results = run(WithoutClockQueryAndJog, Options(only, ALL, undefined=True, examples=1))
    assert results.label.endswith(", without get_time, jog")
    assert results.verdict.good
    assert results.notices == ()


@pytest.mark.parametrize(
    ("allowed", "failed", "notices"),
    [
        (ALL, ["claim.lacks.get_time", "claim.lacks.jog"], 0),
        (frozenset({Hazard.READ_ONLY}), ["claim.lacks.get_time"], 1),
    ],
)
def test_a_false_claim(allowed: frozenset[Hazard], failed: list[str], notices: int) -> None:
    """A command that is answered is served; without its hazard the claim is not verified."""
    options = replace(Options(only=frozenset({"4.7/2"})), allowed=allowed)
    results = run(ControllerCore, options)
    assert [case.id for case in results.cases if case.verdict is Verdict.FAIL] == failed
    assert results.verdict is Conclusion.NONCONFORMANT
    assert len(results.notices) == notices
    assert all("--allow motion tests it" in notice for notice in results.notices)
