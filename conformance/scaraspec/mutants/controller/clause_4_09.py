"""Faults of clause 4.9: what is said of the program that runs."""

from abc import ABC, abstractmethod
from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersLengths, AltersReplies
from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_RUNNING: Final = 0x0A
_NAME_BYTES: Final = 12
_MINUTE_S, _HOUR_S, _DAY_S = 60, 3600, 86_400
_LAG_S: Final = 3.0


class _AltersTelling(AltersReplies, ABC):
    """A program that runs is told otherwise."""

    opcode = _RUNNING

    @abstractmethod
    def told(self, name: bytes, time: bytes) -> bytes:
        """What is sent of a program and its run time."""

    def altered(self, data: bytes) -> bytes:
        """Alter it where one runs."""
        if data[:1] != b"1":
            return data
        name, _, time = data[2:].rpartition(b"|")
        return self.told(name, time)


class _TellsOtherwise(ControllerCore, ABC):
    """The name or the run time is another one."""

    @abstractmethod
    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram | None:
        """What is told in place of this."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Tell that."""
        told = super().get_running_program(request)
        return None if told is None else self.wrong(told, request)


# No program


@mutant("none-is-an-empty-reply", "4.9/6", "4.9/7")
class NoneIsAnEmptyReply(AltersReplies):
    """Where no program runs the reply has no data."""

    opcode = _RUNNING

    def altered(self, data: bytes) -> bytes:
        """Leave the 0 away."""
        return b"" if data == b"0" else data


@mutant("none-has-time", "4.9/6", "4.9/7")
class NoneHasTime(AltersReplies):
    """Where no program runs a time of zeros is told."""

    opcode = _RUNNING

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return b"0||00000000" if data == b"0" else data


@mutant("none-is-the-last-program", "4.9/6")
class NoneIsTheLastProgram(AltersReplies):
    """Behind the end of a program its name stays behind the 0."""

    opcode = _RUNNING
    _last = b""

    def altered(self, data: bytes) -> bytes:
        """Keep it."""
        if data[:1] == b"1":
            self._last = data[1:]
        return b"0" + self._last if data == b"0" else data


@mutant("ended-program-is-told", "4.9/6", "4.9/10", subtle=True)
class EndedProgramIsTold(ControllerCore):
    """For some seconds behind its end a program is told to run."""

    _last: tuple[RunningProgram, float] | None = None

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Keep the last one."""
        told = super().get_running_program(request)
        if told is not None:
            self._last = told, request.now_s
        elif self._last is not None and request.now_s - self._last[1] < _LAG_S:
            return self._last[0]
        return told


@mutant("none-with-zero-time", "4.9/6")
class NoneWithZeroTime(AltersReplies):
    """Where no program runs the 0 is followed by a bar and another 0."""

    opcode = _RUNNING

    def altered(self, data: bytes) -> bytes:
        """Add them."""
        return b"0|0" if data == b"0" else data


# A program


@mutant("telling-without-bars", "4.9/2")
class TellingWithoutBars(_AltersTelling):
    """Flag, name and time follow on each other without bars."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Leave them away."""
        return b"1" + name + time


@mutant("telling-between-blanks", "4.9/2")
class TellingBetweenBlanks(_AltersTelling):
    """Flag, name and time stand between blanks."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Put them in."""
        return b" ".join((b"1", name, time))


@mutant("time-before-name", "4.9/2")
class TimeBeforeName(_AltersTelling):
    """The run time stands before the name."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Mix them up."""
        return b"|".join((b"1", time, name))


@mutant("run-is-not-told", "4.9/2", "4.9/10")
class RunIsNotTold(_TellsOtherwise):
    """While a program runs the reply is 0."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram | None:  # noqa: ARG002 - whatever runs
        """Tell nothing of a real run."""
        task = self.robot.task
        return told if task and task.request.command.name == "simulate_program" else None


@mutant("run-is-told-for-two-seconds", "4.9/2", "4.9/10", subtle=True)
class RunIsToldForTwoSeconds(_TellsOtherwise):
    """A program that has run for two seconds is told no more."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram | None:  # noqa: ARG002 - whoever asks
        """Forget it."""
        return told if told.run_time_s < 2 else None


@mutant("name-is-cut", "4.9/4")
class NameIsCut(_TellsOtherwise):
    """Of the name twelve bytes are told."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Cut it."""
        return told._replace(name=told.name[:_NAME_BYTES])


@mutant("name-of-thirty-loses-one", "4.9/4", subtle=True)
class NameOfThirtyLosesOne(_TellsOtherwise):
    """A name of thirty bytes loses its last one: there is no room for its NUL."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Cut it."""
        return told._replace(name=told.name[:29])


@mutant("name-of-the-first-program", "4.9/4")
class NameOfTheFirstProgram(_TellsOtherwise):
    """The name is that of the program that was stored first."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Look at the store."""
        return told._replace(name=self.store.names()[0])


@mutant("simulated-name-is-missing", "4.9/4")
class SimulatedNameIsMissing(_TellsOtherwise):
    """Of a simulated program the word SIMULATION is told for its name."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Look at what executes."""
        task = self.robot.task
        simulated = task is not None and task.request.command.name == "simulate_program"
        return told._replace(name=b"SIMULATION") if simulated else told


@mutant("simulated-name-is-the-last-run", "4.9/4", subtle=True)
class SimulatedNameIsTheLastRun(_TellsOtherwise):
    """While a program is simulated the name of the one that was run last is told."""

    _ran = b""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Tell that, where one was run."""
        task = self.robot.task
        simulated = task is not None and task.request.command.name == "simulate_program"
        return told._replace(name=self._ran) if simulated and self._ran else told

    def run_program(self, request: Request) -> Acceptance:
        """Keep its name."""
        answer = super().run_program(request)
        if answer.accepted:
            self._ran = request.value
        return answer


@mutant("running-length-as-printed", "4.9/9")
class RunningLengthAsPrinted(AltersLengths):
    """The length byte does not count the two bars, as in the document's row."""

    opcode = _RUNNING

    def length(self, size_bytes: int) -> int:
        """Leave them out."""
        return size_bytes - 2 if size_bytes > 1 else size_bytes


# Its run time


@mutant("run-time-in-plain-seconds", "4.9/3")
class RunTimeInPlainSeconds(_AltersTelling):
    """The run time is a number of seconds in eight digits."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Count seconds."""
        days, hours, minutes, seconds = (int(time[i : i + 2]) for i in range(0, 8, 2))
        total_s = days * _DAY_S + hours * _HOUR_S + minutes * _MINUTE_S + seconds
        return b"1|" + name + b"|%08d" % total_s


@mutant("run-time-of-six-digits", "4.9/3")
class RunTimeOfSixDigits(_AltersTelling):
    """The run time has no days."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Leave them away."""
        return b"1|" + name + b"|" + time[2:]


@mutant("run-time-with-colons", "4.9/3")
class RunTimeWithColons(_AltersTelling):
    """The run time is written with colons."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Put them in."""
        return b"1|" + name + b"|" + b":".join(time[i : i + 2] for i in range(0, 8, 2))


@mutant("hours-go-beyond-the-day", "4.9/3", subtle=True)
class HoursGoBeyondTheDay(_AltersTelling):
    """Hours go on behind 23, and days stay 00."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Count on."""
        hours = int(time[:2]) * 24 + int(time[2:4])
        return b"1|" + name + b"|00%02d" % hours + time[4:]


@mutant("minutes-go-beyond-the-hour", "4.9/3", subtle=True)
class MinutesGoBeyondTheHour(_AltersTelling):
    """Minutes go on behind 59, and hours stay 00."""

    def told(self, name: bytes, time: bytes) -> bytes:
        """Count on."""
        minutes = int(time[2:4]) * 60 + int(time[4:6])
        return b"1|" + name + b"|" + time[:2] + b"00%02d" % (minutes % 100) + time[6:]


@mutant("run-time-stands-still", "4.9/5")
class RunTimeStandsStill(_TellsOtherwise):
    """The run time is zero all the time."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Tell none."""
        return told._replace(run_time_s=0)


@mutant("run-time-runs-fast", "4.9/5")
class RunTimeRunsFast(_TellsOtherwise):
    """The run time counts each second twice."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Count twice."""
        return told._replace(run_time_s=told.run_time_s * 2)


@mutant("minutes-are-lost", "4.9/5", subtle=True)
class MinutesAreLost(_TellsOtherwise):
    """At each full minute the run time begins anew."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Lose them."""
        return told._replace(run_time_s=told.run_time_s % _MINUTE_S)


@mutant("hours-are-lost", "4.9/5", subtle=True)
class HoursAreLost(_TellsOtherwise):
    """At each full hour the run time begins anew."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Lose them."""
        return told._replace(run_time_s=told.run_time_s % _HOUR_S)


@mutant("days-are-lost", "4.9/5", subtle=True)
class DaysAreLost(_TellsOtherwise):
    """At each full day the run time begins anew."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Lose them."""
        return told._replace(run_time_s=told.run_time_s % _DAY_S)


@mutant("run-time-overflows", "4.9/5", subtle=True)
class RunTimeOverflows(_TellsOtherwise):
    """The run time is kept in sixteen bits of seconds."""

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Overflow."""
        return told._replace(run_time_s=told.run_time_s % 2**16)


@mutant("run-time-since-the-first-question", "4.9/5")
class RunTimeSinceTheFirstQuestion(_TellsOtherwise):
    """The run time counts how often it was asked for."""

    _count = 0

    def wrong(self, told: RunningProgram, request: Request) -> RunningProgram:  # noqa: ARG002 - whoever asks
        """Count."""
        self._count += 1
        return told._replace(run_time_s=self._count)
