"""Recorded runs: the duration and the steps of each case in a run that passes.

The suite runs against the unmodified virtual controller and reference client on the simulated
clock. `python -m scaraspec.mutants.recorded_runs` writes the file that `suite.engine.case_sheet`
reads; `make spec` calls it.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from scaraspec.client.aio import AsyncClient
from scaraspec.mutants.client_run import MemoryClient
from scaraspec.mutants.controller_run import (
    PASSWORD,
    Robot,
    RobotOperator,
    certified,
    hooks_of,
    tokens,
)
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame, Framer, StreamItem
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Case, Results, Role
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.case_sheet import RECORDED_RUNS
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.role_adapter import RoleAdapter
from scaraspec.suite.engine.run import Run
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.virtual_controller.core import ControllerCore

if TYPE_CHECKING:
    from scaraspec.protocol.direction import Direction

_LONGEST_PERIOD: Final = 12
_SHOWN_PARTS: Final = 14
_CONTROL: Final = ("connect", "login", "get_status", "close")
_ENDS: Final = {Kind.CLOSED: "close", Kind.RESET: "abort"}
_EVERYTHING: Final = Options(allowed=ALL, undefined=True, exhaustive=True)


class StepRecorder:
    """Collects the steps of the running case from the wire events.

    A step on another connection than the one before names the number of its connection. Numbers of
    closed connections are used again.

    Attributes:
        steps: The steps by case id, in order.
    """

    def __init__(self) -> None:
        self.steps: dict[str, list[str]] = {}
        self._here: list[str] = []
        self._open: dict[str, int] = {}
        self._before = 1
        self._framers: dict[tuple[str, Direction], Framer] = {}

    def begin(self, case: cases.Case) -> None:
        """Begin a case."""
        self._here = self.steps[case.id] = []
        self.forget()

    def end(self) -> None:
        """End the running case: what follows belongs to no case."""
        self._here = []

    def forget(self) -> None:
        """Drop the steps of the running case so far: they prepare all later cases, too."""
        self._here.clear()
        self._open.clear()
        self._before = 1

    def take(self, event: WireEvent) -> None:
        """Add the steps of a wire event."""
        if event.kind is Kind.OPENED:
            self._add(event.connection, "connect")
        elif event.kind in _ENDS:
            self._add(event.connection, _ENDS[event.kind])
            del self._open[event.connection]
        elif event.kind is Kind.BYTES:
            place = event.connection, event.direction
            framer = self._framers.setdefault(place, Framer(event.direction))
            for item in framer.feed(event.data):
                if step := _step(item):
                    self._add(event.connection, step)

    def _add(self, connection: str, step: str) -> None:
        if connection not in self._open:
            self._open[connection] = min({*range(1, len(self._open) + 2)} - {*self._open.values()})
        number = self._open[connection]
        self._here.append(step if number == self._before else f"[{number}] {step}")
        self._before = number


def _step(item: StreamItem) -> str:
    """Return the step that a frame is; empty for a first reply."""
    if not isinstance(item, Frame):
        return "invalid bytes"
    command = BY_OPCODE.get(item.opcode)
    if command is None:
        return f"opcode 0x{item.opcode:02X}"
    if item.tagged:
        return f"result of {command.name}"
    return command.name if item.direction is command.initiator else ""


def _without_control(steps: Sequence[str]) -> Sequence[str]:
    """Return the steps without the positive control after the case."""
    return steps[: -len(_CONTROL)] if (*steps[-len(_CONTROL) :],) == _CONTROL else steps


def compressed(steps: Sequence[str]) -> str:
    """Return steps in one line: each repeated sequence once, with the number of its repetitions.

    A line of more than 14 parts is cut and ends with an ellipsis.
    """
    parts = [*_parts(steps)]
    more = ["…"] if len(parts) > _SHOWN_PARTS else []
    return ", ".join([*parts[:_SHOWN_PARTS], *more])


def _parts(steps: Sequence[str]) -> Iterator[str]:
    at = 0
    while at < len(steps):
        best, count = 1, 1
        for period in range(1, _LONGEST_PERIOD + 1):
            times = _repetitions(steps, at, period)
            if times > 1 and times * period > best * count:
                best, count = period, times
        unit = ", ".join(steps[at : at + best])
        yield unit if count == 1 else f"{unit} ×{count}" if best == 1 else f"({unit}) ×{count}"
        at += best * count


def _repetitions(steps: Sequence[str], at: int, period: int) -> int:
    count = 1
    unit = steps[at : at + period]
    while steps[at + count * period : at + (count + 1) * period] == unit:
        count += 1
    return count


@dataclass(frozen=True)
class _RecordedAdapter(ControllerAdapter):
    """An adapter whose preparation of the first motion belongs to no case."""

    forget: Callable[[], None] = lambda: None

    def make_ready(self, subject: ControllerUnderTest) -> None:
        """Prove the emergency stop, and forget the steps."""
        super().make_ready(subject)
        self.forget()


def recorded_runs(role: Role, options: Options = _EVERYTHING) -> dict[str, dict[str, Any]]:
    """Run the suite against our own implementation of a role, and return what each case did.

    Args:
        role: The role of the subject.
        options: Options of the run.

    Returns:
        By case id: the waits in seconds, the steps, their number, the number of values, and of a
        case that asks an operator the number of requests.
    """
    requests = dict[str, int]()
    steps = StepRecorder()
    if role is Role.CONTROLLER:
        robot = Robot(ControllerCore, DEFAULT)
        adapter = _RecordedAdapter(
            MemoryAccess(robot.network),
            Ics(hooks=hooks_of(robot)),
            PASSWORD,
            options,
            draw_token=tokens().__next__,
            forget=steps.forget,
        )
        results = _run(adapter, steps)
        requests = _operator_requests(options)
    else:
        with closing(MemoryClient(AsyncClient, DEFAULT)) as access:
            client = ClientAdapter(access, Ics(), options)
            results = _run(client, steps)
    return {
        case.id: _recorded(case, steps.steps[case.id], requests.get(case.id, 0))
        for case in results.cases
    }


def _operator_requests(options: Options) -> dict[str, int]:
    """Return how many requests each case makes to an operator if the ICS defines no hook."""
    attended = frozenset(case.id for case in collect(options) if case.attended)
    robot = Robot(ControllerCore, DEFAULT)
    only = replace(options, only=frozenset(), cases=attended, attended=True)
    results = certified(robot, Ics(), only, RobotOperator(robot))
    return {case.id: len(case.operator) for case in results.cases}


def _run(adapter: RoleAdapter[Any], steps: StepRecorder) -> Results:
    return Run(
        adapter,
        take=steps.take,
        announce=steps.begin,
        report=lambda _outcome, _count: steps.end(),
    ).results()


def _recorded(case: Case, steps: Sequence[str], requests: int) -> dict[str, Any]:
    own = _without_control(steps)
    return {
        "waits_s": round(case.duration_s, 2),
        "steps": compressed(own),
        "count": len(own),
        "examples": case.examples,
        **({"asked": requests} if requests else {}),
    }


def _text(recorded: Mapping[str, Mapping[str, object]]) -> str:
    """Return JSON with one line per case."""
    roles = (
        f'"{role}": {{\n'
        + ",\n".join(f'"{i}": {json.dumps(run, ensure_ascii=False)}' for i, run in runs.items())
        + "\n}"
        for role, runs in recorded.items()
    )
    return "{\n" + ",\n".join(roles) + "\n}\n"


if __name__ == "__main__":
    recorded = {role.value: recorded_runs(role) for role in (Role.CONTROLLER, Role.CLIENT)}
    RECORDED_RUNS.write_text(_text(recorded), "utf-8")
