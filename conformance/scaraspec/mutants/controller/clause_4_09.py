"""Mutants of clause 4.9: the running program."""

from collections.abc import Callable
from typing import Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte
from scaraspec.mutants.operators.controller.requests import after
from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import SIMULATING
from scaraspec.virtual_controller.session import Request, Session

_MINUTE_S, _HOUR_S, _DAY_S = 60, 3600, 86_400
_REPLY: Final = "get_running_program"


def _is_simulated(core: ControllerCore) -> bool:
    return core.robot.task is not None and core.robot.task.state == SIMULATING


def _without_program(data: bytes) -> Core:
    """If no program runs, the reply is replaced by `data`."""
    return first_reply(_REPLY, {b"0": data})


def _with_program(change: Callable[[bytes, bytes], bytes]) -> Core:
    """If a program runs, the reply is what `change` returns for its name and encoded run time."""

    def changed(data: bytes) -> bytes:
        if data[:1] != b"1":
            return data
        name, _, time = data[2:].rpartition(b"|")
        return change(name, time)

    return first_reply(_REPLY, changed)


def _program(change: Callable[[ControllerCore, RunningProgram], RunningProgram | None]) -> Core:
    """`change` replaces the running program in the reply."""
    return after(
        _REPLY, lambda core, _request, program: None if program is None else change(core, program)
    )


def _run_time(change: Callable[[int], int]) -> Core:
    """The run time is changed."""
    return _program(lambda _core, shown: shown._replace(run_time_s=change(shown.run_time_s)))


def _pairs(time: bytes) -> list[bytes]:
    return [time[i : i + 2] for i in range(0, 8, 2)]


def _in_seconds(name: bytes, time: bytes) -> bytes:
    days, hours, minutes, seconds = map(int, _pairs(time))
    total_s = days * _DAY_S + hours * _HOUR_S + minutes * _MINUTE_S + seconds
    return b"1|%b|%08d" % (name, total_s)


def _without_days(name: bytes, time: bytes) -> bytes:
    hours = int(time[:2]) * 24 + int(time[2:4])
    return b"1|%b|00%02d%b" % (name, hours, time[4:])


def _without_hours(name: bytes, time: bytes) -> bytes:
    minutes = int(time[2:4]) * 60 + int(time[4:6])
    return b"1|%b|%b00%02d%b" % (name, time[:2], minutes % 100, time[6:])


# Without a running program

row(
    "none-is-an-empty-reply",
    "4.9/6 4.9/7",
    "When no program runs, the reply has no data.",
    _without_program(b""),
)
row(
    "none-has-time",
    "4.9/6 4.9/7",
    "When no program runs, the reply contains an empty name and a time of zeros.",
    _without_program(b"0||00000000"),
)


@mutant("none-is-the-last-program", "4.9/6")
class KeepsLastProgram(ControllerCore):
    """When no program runs, the 0 is followed by the last reported name and run time."""

    _last = b""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x0A and frame.data[:1] == b"1":
            self._last = frame.data[1:]
        if frame.opcode == 0x0A and frame.data == b"0":
            frame = frame._replace(data=b"0" + self._last)
        super().emit(session, frame)


@mutant("ended-program-is-told", "4.9/6", "4.9/10", subtle=True)
class ReportsEndedProgram(ControllerCore):
    """A program is reported for 3 s after the last reply during its run."""

    _last: tuple[RunningProgram, float] | None = None

    def get_running_program(self, request: Request) -> RunningProgram | None:
        program = super().get_running_program(request)
        if program is not None:
            self._last = program, request.now_s
        elif self._last is not None and request.now_s - self._last[1] < 3.0:
            return self._last[0]
        return program


row(
    "none-with-zero-time",
    "4.9/6",
    "When no program runs, the 0 is followed by a bar and another 0.",
    _without_program(b"0|0"),
)

# With a running program

row(
    "telling-without-bars",
    "4.9/2",
    "There are no bars between flag, name and run time.",
    _with_program(lambda name, time: b"1" + name + time),
)
row(
    "telling-between-blanks",
    "4.9/2",
    "Blanks separate flag, name and run time.",
    _with_program(lambda name, time: b" ".join((b"1", name, time))),
)
row(
    "time-before-name",
    "4.9/2",
    "The run time precedes the name.",
    _with_program(lambda name, time: b"|".join((b"1", time, name))),
)
row(
    "run-is-not-told",
    "4.9/2 4.9/10",
    "While a program runs, the reply is 0.",
    _program(lambda core, shown: shown if _is_simulated(core) else None),
)
row(
    "run-is-told-for-two-seconds",
    "4.9/2 4.9/10",
    "From its second 2 on, a running program is not reported.",
    _program(lambda _core, shown: shown if shown.run_time_s < 2 else None),
    subtle=True,
)
row(
    "name-is-cut",
    "4.9/4",
    "The name is cut to twelve bytes.",
    _program(lambda _core, shown: shown._replace(name=shown.name[:12])),
)
row(
    "name-of-thirty-loses-one",
    "4.9/4",
    "The name is cut to 29 bytes.",
    _program(lambda _core, shown: shown._replace(name=shown.name[:29])),
    subtle=True,
)
row(
    "name-of-the-first-program",
    "4.9/4",
    "The name is that of the first stored program.",
    _program(lambda core, shown: shown._replace(name=core.store.names()[0])),
)
row(
    "simulated-name-is-missing",
    "4.9/4",
    "While a program is simulated, its name is SIMULATION.",
    _program(
        lambda core, shown: shown._replace(name=b"SIMULATION") if _is_simulated(core) else shown
    ),
)


@mutant("simulated-name-is-the-last-run", "4.9/4", subtle=True)
class ReportsLastRunDuringSimulation(ControllerCore):
    """While a program is simulated, the name of the last run program is reported."""

    _ran = b""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        program = super().get_running_program(request)
        if program is not None and self._ran and _is_simulated(self):
            return program._replace(name=self._ran)
        return program

    def run_program(self, request: Request) -> Acceptance:
        reply = super().run_program(request)
        if reply.accepted:
            self._ran = request.value
        return reply


row(
    "running-length-as-printed",
    "4.9/9",
    "The length byte does not count the two bars, as in the table row of the document.",
    length_byte(_REPLY, lambda size_bytes: size_bytes - 2 if size_bytes > 1 else size_bytes),
)

# Run time

row(
    "run-time-in-plain-seconds",
    "4.9/3",
    "The run time is a number of seconds with eight digits.",
    _with_program(_in_seconds),
)
row(
    "run-time-of-six-digits",
    "4.9/3",
    "The run time has no days.",
    _with_program(lambda name, time: b"1|%b|%b" % (name, time[2:])),
)
row(
    "run-time-with-colons",
    "4.9/3",
    "Colons separate the parts of the run time.",
    _with_program(lambda name, time: b"1|%b|%b" % (name, b":".join(_pairs(time)))),
)
row(
    "hours-go-beyond-the-day",
    "4.9/3",
    "Hours continue after 23, and days stay 00.",
    _with_program(_without_days),
    subtle=True,
)
row(
    "minutes-go-beyond-the-hour",
    "4.9/3",
    "Minutes continue after 59, and hours stay 00.",
    _with_program(_without_hours),
    subtle=True,
)
row(
    "run-time-stands-still",
    "4.9/5",
    "The run time is always zero.",
    _run_time(lambda _time_s: 0),
)
row(
    "run-time-runs-fast",
    "4.9/5",
    "The run time counts each second twice.",
    _run_time(lambda time_s: time_s * 2),
)
row(
    "minutes-are-lost",
    "4.9/5",
    "The run time restarts at zero after each minute.",
    _run_time(lambda time_s: time_s % _MINUTE_S),
    subtle=True,
)
row(
    "hours-are-lost",
    "4.9/5",
    "The run time restarts at zero after each hour.",
    _run_time(lambda time_s: time_s % _HOUR_S),
    subtle=True,
)
row(
    "days-are-lost",
    "4.9/5",
    "The run time restarts at zero after each day.",
    _run_time(lambda time_s: time_s % _DAY_S),
    subtle=True,
)
row(
    "run-time-begins-at-two-days",
    "4.9/5",
    "The run time of every program begins at two days.",
    _run_time(lambda time_s: time_s + 2 * _DAY_S),
)
row(
    "run-time-overflows",
    "4.9/5",
    "The run time is stored in 16 bits of seconds.",
    _run_time(lambda time_s: time_s % 2**16),
    subtle=True,
)


@mutant("run-time-since-the-first-question", "4.9/5")
class CountsRequestsInRunTime(ControllerCore):
    """The run time is the number of requests for it."""

    _count = 0

    def get_running_program(self, request: Request) -> RunningProgram | None:
        program = super().get_running_program(request)
        if program is None:
            return None
        self._count += 1
        return program._replace(run_time_s=self._count)
