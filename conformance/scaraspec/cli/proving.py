"""Proving: the suite run against the virtual controller in memory, as it is or with seeded faults.

The one place where both meet. The machine can be handled as a real subject can by the hooks of its
statement of conformance: switched off and on, its inputs driven, its motors broken.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Final, Literal

from allpairspy import AllPairs  # type: ignore[import-untyped] # it ships no types

from scaraspec.controller.brain import Brain
from scaraspec.controller.control import ControlError, obey
from scaraspec.controller.faults import Fault, faults
from scaraspec.controller.plant import Plant
from scaraspec.controller.session import Action, Close
from scaraspec.controller.store import Store
from scaraspec.judgement.verdicts import Conclusion, Verdict
from scaraspec.links.memory import MemoryNetwork
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.report.model import Results
from scaraspec.suite.as_client.access import MemoryAccess
from scaraspec.suite.hooks import HookError
from scaraspec.suite.plan import Options
from scaraspec.suite.run import Run, Setting
from scaraspec.suite.statement import Statement

_ALARMING: Final = (Verdict.INCONCLUSIVE, Verdict.FAIL, Verdict.ERROR)

PASSWORD: Final = b"password"  # the virtual controller's own
_EPOCH_NS: Final = 1_767_225_600_000_000_000  # 2026-01-01
_BEGIN: Final = datetime(2026, 1, 1)  # noqa: DTZ001 - the document names no zone

_LINES: Final[Mapping[str, str]] = {
    "set_input": "input {port} {value}",
    "set_analog": "analog {port} {value}",
    "motor_fault": "motor-fault {joints} lasting",
    "position_fault": "position-fault lasting",
    "angle_fault": "angle-fault lasting",
    "clear_faults": "clear",
    "disk_full": "disk-full on",
    "disk_free": "disk-full off",
}


class Robot:
    """A virtual controller that can be switched off and on; see `links.memory.Machine`."""

    def __init__(self, make: type[Brain], dialect: Dialect) -> None:
        self.network = MemoryNetwork(self, epoch_ns=_EPOCH_NS)
        self._make, self._dialect = make, dialect
        self._store = Store()
        self._plant = Plant(_BEGIN, 0.0)
        self._brain = make(self._plant, self._store, dialect)
        self._open: set[int] = set()

    @property
    def next_event_s(self) -> float | None:
        """When something happens by itself."""
        return self._brain.next_event_s

    def open(
        self, connection: int, now_s: float, link: Literal["tcp", "serial"]
    ) -> Sequence[Action]:
        """A client has connected."""
        self._open.add(connection)
        return self._brain.open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        """Bytes have arrived."""
        return self._brain.receive(connection, data, now_s)

    def close(self, connection: int, now_s: float) -> Sequence[Action]:
        """A client sends no more."""
        self._open.discard(connection)
        return self._brain.close(connection, now_s)

    def advance(self, now_s: float) -> Sequence[Action]:
        """Time has passed."""
        return self._brain.advance(now_s)

    def restart(self) -> None:
        """Switch it off and on: programs and settings stay, all else begins anew."""
        now_s = self.network.now_s
        self.network.perform([Close(connection) for connection in self._open])
        self._open.clear()
        clock = self._plant.clock.time(now_s)
        self._plant = Plant(clock, now_s)
        self._brain = self._make(self._plant, self._store, self._dialect)

    def handle(self, line: str) -> None:
        """Break or drive the plant.

        Raises:
            HookError: The line says nothing that can be done.
        """
        now_s = self.network.now_s
        try:
            obey(line, self._plant, now_s)
        except ControlError as error:
            raise HookError(f"{error}") from None
        self.network.perform(self._brain.advance(now_s))


@dataclass(frozen=True, slots=True)
class _RobotHook:
    """A hook without a command line."""

    act: Callable[[Mapping[str, object]], None]

    def run(self, **values: object) -> None:
        """Do it."""
        self.act(values)


def prove(options: Options, fault: Fault | None = None, dialect: Dialect | None = None) -> Results:
    """Run the suite against the virtual controller.

    Args:
        options: What to try.
        fault: What is wrong with it; None for nothing.
        dialect: The readings that it follows, which it claims too.
    """
    spoken = dialect or Dialect.parse(fault.reading if fault else ())
    robot = Robot(fault.brain if fault else Brain, spoken)
    statement = Statement(
        name=fault.name if fault else "virtual controller",
        dialect=spoken,
        claimed=frozenset(spoken.differences()),
        hooks=_hooks(robot),
    )
    access = MemoryAccess(robot.network)
    return Run(Setting(access, statement, PASSWORD, options, link="memory")).results()


@dataclass(frozen=True, slots=True)
class Proof:
    """What the suite found of one fault.

    Attributes:
        fault: Its name.
        sentence: What it does wrong.
        requirements: What it violates.
        failures: Every case that failed, and its message.
        killers: Those that failed of a requirement that the fault violates.
    """

    fault: str
    sentence: str
    requirements: tuple[str, ...]
    failures: Mapping[str, str]
    killers: tuple[str, ...]

    def plain(self) -> dict[str, object]:
        """As JSON can hold it."""
        return asdict(self)


def proof_of(name: str, options: Options, *, quick: bool) -> Proof:
    """Run the suite against a fault; a quick run tries only the cases of what it violates."""
    fault = faults()[name]
    violated = frozenset(fault.requirements)
    if quick:
        options = replace(options, only=violated)
    failed = [case for case in prove(options, fault).cases if case.verdict is Verdict.FAIL]
    return Proof(
        name,
        fault.sentence,
        fault.requirements,
        {case.id: case.message for case in failed},
        tuple(case.id for case in failed if violated & set(case.requirements)),
    )


@dataclass(frozen=True, slots=True)
class Alarm:
    """What the suite says of a faultless controller that follows other readings.

    Attributes:
        readings: Where it differs from the default, as ``key=option``.
        verdict: What the run amounts to.
        cases: Every case that is neither passed, tolerated nor left out, and its message.
    """

    readings: tuple[str, ...]
    verdict: str
    cases: Mapping[str, str]

    @property
    def false(self) -> bool:
        """Whether it is a false alarm."""
        return self.verdict != Conclusion.CONFORMANT.value


def alarm_of(dialect: Dialect, options: Options) -> Alarm:
    """Run the suite against a faultless controller of this dialect."""
    results = prove(options, dialect=dialect)
    return Alarm(
        tuple(f"{key}={option}" for key, option in dialect.differences().items()),
        results.verdict.value,
        {case.id: case.message for case in results.cases if case.verdict in _ALARMING},
    )


def dialects() -> Iterator[Dialect]:
    """Every reading but the default by itself, then dialects in which every pair of them occurs.

    Without a blank in place of the bar, which the register lists and calls wrong (A-0-2).
    """
    several = [r for r in READINGS.values() if len(r.options) > 1 and r.key != "err_sep"]
    for reading in several:
        for option in reading.options[1:]:
            yield Dialect({reading.key: option.name})
    for names in AllPairs([[option.name for option in r.options] for r in several]):
        yield Dialect(dict(zip((r.key for r in several), names, strict=True)))


def _hooks(robot: Robot) -> dict[str, _RobotHook]:
    lines = {
        name: _RobotHook(lambda values, line=line: robot.handle(line.format(**values)))  # type: ignore[misc] # mypy knows no defaults of a lambda
        for name, line in _LINES.items()
    }
    anew = _RobotHook(lambda _: robot.restart())
    return {**lines, "restart": anew, "power_cut": anew}
