"""Faults between the clauses: state that leaks from one command into another, or errs late.

Each command by itself is right; it takes others before it, or many of them, to show the fault.
"""

from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_LATE: Final = 300
"""Requests behind which late faults show."""


class _Counts(ControllerCore):
    """Counts requests."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.requests = 0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Count."""
        self.requests += 1
        super().handle(session, frame, now_s)

    @property
    def late(self) -> bool:
        """Whether many have come."""
        return self.requests > _LATE


# ---------------------------------------------------------------------- files


@mutant("any-deletion-forgets-the-default", "4.13/3", subtle=True)
class AnyDeletionForgetsTheDefault(ControllerCore):
    """Whatever program is deleted, the default one is forgotten with it."""

    def delete_program(self, request: Request) -> bool:
        """Forget it."""
        done = super().delete_program(request)
        if done:
            self.save(default_program=b"")
        return done


@mutant("list-is-made-when-the-number-changes", "4.10/11", subtle=True)
class ListIsMadeWhenTheNumberChanges(ControllerCore):
    """The list is kept until there are more or fewer programs than when it was made."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._names: list[bytes] = []

    def list_programs(self, request: Request) -> NameListPart:
        """Tell what was kept."""
        names = self.store.names()
        if len(names) != len(self._names):
            self._names = names
        if self._names == names:
            return super().list_programs(request)
        return NameListPart(more=False, names=tuple(self._names))


@mutant("downloads-from-its-cache", "5.2/12", subtle=True)
class DownloadsFromItsCache(ControllerCore):
    """A file that was downloaded is kept in memory, even if it was the default and is deleted."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._cache: dict[bytes, bytes] = {}

    def download_name(self, request: Request) -> bool:
        """Send what was kept, where there is a file of this name."""
        name = request.value
        if name in self.store:
            content = self._cache.setdefault(name, self.store.read(name))
            self.store.write(name, content)
        return super().download_name(request)

    def delete_program(self, request: Request) -> bool:
        """Forget it, unless it is the default."""
        if request.value != self.store.settings.default_program:
            self._cache.pop(request.value, None)
        return super().delete_program(request)


@mutant("setting-the-clock-truncates-the-last-upload", "5.2/12", subtle=True)
class SettingTheClockTruncatesTheLastUpload(ControllerCore):
    """The file that was uploaded last is still open, and loses its last byte with the clock."""

    def set_time(self, request: Request) -> bool:
        """Truncate it."""
        names = self.store.names()
        if names and len(names) > 1:
            self.store.write(names[-1], self.store.read(names[-1])[:-1])
        return super().set_time(request)


# ---------------------------------------------------------------------- settings


@mutant("initial-position-takes-the-centre-along", "4.20/3", subtle=True)
class InitialPositionTakesTheCentreAlong(ControllerCore):
    """An initial position that is set a second time sets the gripper centre to what it was."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._saved: tuple[float, float, float] | None = None

    def set_initial_tool_position(self, request: Request) -> bool:
        """Save or bring back."""
        done = super().set_initial_tool_position(request)
        if done and self._saved is not None:
            self.save(gripper_center=self._saved)
        self._saved = self.store.settings.gripper_center if self._saved is None else None
        return done


@mutant("late-initial-positions-are-lost", "4.21/3", subtle=True)
class LateInitialPositionsAreLost(_Counts):
    """After three hundred requests an initial position is answered 1 and forgotten."""

    def set_initial_tool_position(self, request: Request) -> bool:
        """Forget it."""
        before = self.store.settings.initial_tool_position
        done = super().set_initial_tool_position(request)
        if self.late:
            self.save(initial_tool_position=before)
        return done


@mutant("second-login-sets-the-clock-back", "4.5/4", subtle=True)
class SecondLoginSetsTheClockBack(ControllerCore):
    """A second login on a connection has the clock go on from the first, whatever was set since."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._first: dict[int, tuple[datetime, float]] = {}

    def login(self, request: Request) -> bool:
        """Set it, as far as time has gone on since."""
        connection, clock = request.session.connection, self.plant.clock
        if request.session.logged_in and connection in self._first:
            time, then_s = self._first[connection]
            clock.set(time + timedelta(seconds=request.now_s - then_s), request.now_s)
        else:
            self._first[connection] = clock.time(request.now_s), request.now_s
        return super().login(request)


@mutant("mistaken-password-blocks-the-next", "4.2/2", subtle=True)
class MistakenPasswordBlocksTheNext(ControllerCore):
    """Behind a change with a wrong old password, one with the right one is refused, once."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._mistaken = False

    def set_password(self, request: Request) -> bool:
        """Refuse it."""
        old, new = request.value
        if old == self.store.settings.password and self._mistaken and new != old:
            self._mistaken = False
            return False
        self._mistaken = old != self.store.settings.password
        return super().set_password(request)


# ---------------------------------------------------------------------- programs


@mutant("refused-run-is-told", "4.9/4", subtle=True)
class RefusedRunIsTold(ControllerCore):
    """Behind a run that was refused because another one goes on, its name is told as running."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._wrong = b""

    def run_program(self, request: Request) -> Acceptance:
        """Put the name down."""
        task = self.robot.task
        if task is None:
            self._wrong = b""
        elif task.program and request.value in self.store:
            self._wrong = request.value
        return super().run_program(request)

    def get_running_program(self, request: Request) -> Any:
        """Tell it."""
        told = super().get_running_program(request)
        return told._replace(name=self._wrong) if told is not None and self._wrong else told


@mutant("stopped-simulation-undoes-the-setting", "4.32/6", subtle=True)
class StoppedSimulationUndoesTheSetting(ControllerCore):
    """A simulation that is stopped undoes the last setting of an output, as if it were its own."""

    _former: PortValue | None = None

    def set_digital_output(self, request: Request) -> Any:
        """Remember what was there."""
        port, outputs = request.value.port, self.get_digital_outputs(request)
        if answer := super().set_digital_output(request):
            self._former = PortValue(port, int(outputs[-port]))
        return answer

    def emergency_stop(self, request: Request) -> Acceptance:
        """Put it back."""
        task, former = self.robot.task, self._former
        if task is not None and task.state == "02" and former:
            self.plant.digital_outputs[former.port] = bool(former.value)
        return super().emergency_stop(request)


@mutant("late-runs-miss-their-program", "4.15/4", subtle=True)
class LateRunsMissTheirProgram(_Counts):
    """After three hundred requests a program that was deleted and sent anew is not found."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._deleted: set[bytes] = set()

    def delete_program(self, request: Request) -> bool:
        """Note its name."""
        self._deleted.add(request.value)
        return super().delete_program(request)

    def run_program(self, request: Request) -> Acceptance:
        """Look for another one."""
        if self.late and request.value in self._deleted:
            return super().run_program(replace(request, value=b"gone.rob"))
        return super().run_program(request)
