"""The suite finds the program layout of a subject, and the meaning of its points."""

import pytest

from scaraspec.mutants.controller import ControllerMutant
from scaraspec.mutants.controller_run import prove_controller
from scaraspec.protocol.program_files import LAYOUTS, Layout, Program, ProgramError, parse
from scaraspec.protocol.readings import Dialect
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.program_files.layout import twin_of
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import runnable
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.store import Store

_CASES = Options(only=frozenset({"6.5/26", "6.5/22", "6.5/23"}), allowed=ALL, examples=1)


class _ReadsOne(ControllerCore):
    """Reads programs of one layout, and no others."""

    layout: Layout

    def parse_program(self, data: bytes) -> Program | None:
        """Parse in this layout."""
        try:
            program = parse(data, self.layout)
        except ProgramError:
            return None
        return program if runnable(program, self.dialect) else None


@pytest.mark.parametrize(
    "name", ["lp64", "packed", "packed-long8", "ilp32-header13", "outer-packed-big"]
)
def test_a_robot_of_any_layout_runs_programs(name: str) -> None:
    """A controller that reads only one layout conforms, even if it claims none."""
    core = type("Reads", (_ReadsOne,), {"layout": LAYOUTS[name]})
    results = prove_controller(_CASES, ControllerMutant(name, (), "It reads one layout.", core))
    assert results.verdict.good
    assert results.readings["controller"]["prog_layout"].options == (LAYOUTS[name].reading,)


def test_a_robot_without_programs_fails_once() -> None:
    """A controller that runs no program fails 6.5/26; cases that need programs are inconclusive."""

    class RunsNone(ControllerCore):
        """Parses no program."""

        def parse_program(self, data: bytes) -> None:
            """Return no program."""

    results = prove_controller(_CASES, ControllerMutant("none", (), "It runs none.", RunsNone))
    verdicts = {case.id: (case.verdict.value, case.requirements) for case in results.cases}
    assert ("fail", ("6.5/26",)) in verdicts.values()
    assert sum(verdict == "fail" for verdict, _ in verdicts.values()) == 1


def test_the_meaning_of_points_is_found() -> None:
    """A controller whose points are poses conforms, even if it does not claim so."""

    class Poses(ControllerCore):
        """Treats points as poses."""

        def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
            super().__init__(plant, store, dialect.replace(point_meaning="pose"))

    cases = Options(only=frozenset({"6.5/25", "6.5/27"}), allowed=ALL, examples=1)
    results = prove_controller(cases, ControllerMutant("poses", (), "Its points are poses.", Poses))
    assert results.verdict.good
    assert results.readings["controller"]["point_meaning"].options == ("pose",)


def test_twins_differ_in_their_longs() -> None:
    """Packed layouts with 4 and 8 bytes per long are twins; natural layouts differ in size and have
    none."""
    assert twin_of(LAYOUTS["packed"]) == LAYOUTS["packed-long8"]
    assert twin_of(LAYOUTS["packed-long8-big"]) == LAYOUTS["packed-big"]
    assert twin_of(LAYOUTS["ilp32"]) is None
