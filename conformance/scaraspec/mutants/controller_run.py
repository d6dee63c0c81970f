"""Run the controller suite against the virtual controller in memory, unmodified or as a mutant.

The suite and the virtual controller are used together only here. The hooks of the ICS operate the
simulated robot as they operate a real one: power cycle, inputs, motor faults.
"""

import itertools
import re
import string
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final, Literal

from scaraspec.mutants.controller import ControllerMutant
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.report.model import Results
from scaraspec.report.operator_request import OperatorAnswer
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.own_files import TOKEN_LETTERS
from scaraspec.suite.engine.hooks import REQUESTS, HookError
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.operator import Operator
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.memory import MemoryNetwork
from scaraspec.virtual_controller.console_commands import ConsoleCommandError, execute
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Action, Close
from scaraspec.virtual_controller.store import Store

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
    """A virtual controller that can be switched off and on; see `transports.memory.Machine`."""

    def __init__(self, make: type[ControllerCore], dialect: Dialect) -> None:
        self.network = MemoryNetwork(self, epoch_ns=_EPOCH_NS)
        self._make, self._dialect = make, dialect
        self._store = Store()
        self._plant = Plant(_BEGIN, 0.0)
        self._core = make(self._plant, self._store, dialect)
        self._open: set[int] = set()

    @property
    def next_event_s(self) -> float | None:
        """The time of the next event without a request, or None."""
        return self._core.next_event_s

    def open(
        self, connection: int, now_s: float, link: Literal["tcp", "serial"]
    ) -> Sequence[Action]:
        """A client has connected."""
        self._open.add(connection)
        return self._core.open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        """Bytes have arrived.

        A controller that cannot send a stored value ends the connection, as over TCP.
        """
        try:
            return self._core.receive(connection, data, now_s)
        except PayloadError:
            return [*self.close(connection, now_s), Close(connection)]

    def close(self, connection: int, now_s: float) -> Sequence[Action]:
        """A client sends no more."""
        self._open.discard(connection)
        return self._core.close(connection, now_s)

    def advance(self, now_s: float) -> Sequence[Action]:
        """Time has passed."""
        return self._core.advance(now_s)

    def restart(self) -> None:
        """Switch the power off and on: only programs and settings are kept."""
        now_s = self.network.now_s
        self.network.apply([Close(connection) for connection in self._open])
        self._open.clear()
        clock = self._plant.clock.time(now_s)
        self._plant = Plant(clock, now_s)
        self._core = self._make(self._plant, self._store, self._dialect)

    def set_password(self, password: bytes) -> None:
        """Set the password without a login."""
        self._store.save(replace(self._store.settings, password=password))

    def handle(self, line: str) -> None:
        """Execute a control line that changes the plant.

        Raises:
            HookError: The line is not a valid control line.
        """
        now_s = self.network.now_s
        try:
            execute(line, self._plant, now_s)
        except ConsoleCommandError as error:
            raise HookError(f"{error}") from None
        self.network.apply(self._core.advance(now_s))


@dataclass(frozen=True, slots=True)
class _RobotHook:
    """A hook without a command line."""

    act: Callable[[Mapping[str, object]], None]

    def run(self, **values: object) -> None:
        """Run the hook with these values."""
        self.act(values)


class RobotOperator:
    """An operator who does at once what the suite asks for; see `suite.engine.operator.Operator`.

    Args:
        robot: The robot that the operator works with.

    Attributes:
        requests: The requests, in order.
    """

    def __init__(self, robot: Robot) -> None:
        hooks = hooks_of(robot)
        self._hooks = {**hooks, "start": hooks["restart"]}
        self.requests: list[str] = []

    def ask(self, request: str) -> None:
        """Carry out a request."""
        self.requests.append(request)
        for part in request.split("; "):
            for name, template in REQUESTS.items():
                pattern = re.sub(r"\\{(\w+)\\}", r"(?P<\1>.+)", re.escape(template))
                if found := re.fullmatch(pattern, part):
                    values = {key: _as_value(text) for key, text in found.groupdict().items()}
                    self._hooks[name].run(**values)

    def poll(self, note: Callable[[str], None]) -> OperatorAnswer | None:  # noqa: ARG002 - no remark
        """Return that it has been done."""
        return OperatorAnswer.DONE


def _as_value(text: str) -> str:
    """Return the value of a hook of which the text of a request was made."""
    return text.replace(", ", ",").replace(" ", "_")


def prove_controller(
    options: Options, fault: ControllerMutant | None = None, dialect: Dialect | None = None
) -> Results:
    """Run the suite against the virtual controller.

    Args:
        options: Options of the run.
        fault: The mutant; None for the unmodified controller.
        dialect: The readings of the controller; if given, the ICS claims all readings.
    """
    used = dialect or Dialect.parse(fault.reading if fault else ())
    robot = Robot(fault.wrong if fault else ControllerCore, used)
    ics = Ics(
        name=fault.name if fault else "virtual controller",
        dialect=used,
        claimed=frozenset(READINGS if dialect else used.differences()),
        hooks=hooks_of(robot),
    )
    return certified(robot, ics, options)


def certified(
    robot: Robot, ics: Ics, options: Options, operator: Operator | None = None
) -> Results:
    """Run the suite against this robot.

    Args:
        robot: The simulated robot.
        ics: The claims of the robot.
        options: Options of the run.
        operator: Replaces missing hooks, if the options say that an operator is present.
    """
    access = MemoryAccess(robot.network)
    setting = ControllerAdapter(
        access,
        ics,
        PASSWORD,
        options,
        link="memory",
        draw_token=tokens().__next__,
        operator=operator,
    )
    return Run(setting).results()


def tokens() -> Iterator[str]:
    """Yield the file tokens; they are the same in every run, so that results can be compared."""
    for letters in itertools.product(string.ascii_lowercase, repeat=TOKEN_LETTERS):
        yield "".join(letters)


def hooks_of(robot: Robot) -> dict[str, _RobotHook]:
    """Return the hooks that operate the robot."""
    lines = {
        name: _RobotHook(lambda values, line=line: robot.handle(line.format(**values)))  # type: ignore[misc] # mypy knows no defaults of a lambda
        for name, line in _LINES.items()
    }
    restart_hook = _RobotHook(lambda _: robot.restart())
    reset = _RobotHook(lambda _: robot.set_password(PASSWORD))
    return {**lines, "restart": restart_hook, "power_cut": restart_hook, "factory_reset": reset}
