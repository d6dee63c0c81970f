"""Mutants that show only in sequences: one command changes the effect of another, or many do.

Each command alone is executed correctly.
"""

from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.requests import after
from scaraspec.protocol.commands import PortValue, RunningProgram
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


class _CountsRequests(ControllerCore):
    _requests = 0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._requests += 1
        super().handle(session, frame, now_s)

    @property
    def _is_late(self) -> bool:
        return self._requests > 300


# ---------------------------------------------------------------------- files


def _truncate_last(core: ControllerCore, _request: Request, done: Any) -> Any:
    names = core.store.names()
    if len(names) > 1:
        core.store.write(names[-1], core.store.read(names[-1])[:-1])
    return done


row(
    "any-deletion-forgets-the-default",
    "4.13/3",
    "Deleting any program clears the default program.",
    after("delete_program", lambda core, _request, done: done and core.save(default_program=b"")),
    subtle=True,
)


@mutant("list-is-made-when-the-number-changes", "4.10/11", subtle=True)
class KeepsListOfSameLength(ControllerCore):
    """The list of programs is updated only when their number has changed."""

    _names: tuple[bytes, ...] = ()

    def list_programs(self, request: Request) -> NameListPart:
        names = tuple(self.store.names())
        if len(names) != len(self._names):
            self._names = names
        if self._names == names:
            return super().list_programs(request)
        return NameListPart(more=False, names=self._names)


@mutant("downloads-from-its-cache", "5.2/12", subtle=True)
class DownloadsFromCache(ControllerCore):
    """Downloads come from a cache, which still contains a default program that was deleted."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._cache: dict[bytes, bytes] = {}

    def download_name(self, request: Request) -> bool:
        name = request.value
        if name in self.store:
            content = self._cache.setdefault(name, self.store.read(name))
            self.store.write(name, content)
        return super().download_name(request)

    def delete_program(self, request: Request) -> bool:
        if request.value != self.store.settings.default_program:
            self._cache.pop(request.value, None)
        return super().delete_program(request)


row(
    "setting-the-clock-truncates-the-last-upload",
    "5.2/12",
    "Setting the clock removes the last byte of the last of several programs.",
    after("set_time", _truncate_last),
    subtle=True,
)


# ---------------------------------------------------------------------- settings


@mutant("initial-position-takes-the-centre-along", "4.20/3", subtle=True)
class RestoresGripperCenter(ControllerCore):
    """A second initial position restores the gripper centre that was set at the first one."""

    _saved: tuple[float, float, float] | None = None

    def set_initial_tool_position(self, request: Request) -> bool:
        done = super().set_initial_tool_position(request)
        if done and self._saved is not None:
            self.save(gripper_center=self._saved)
        self._saved = self.store.settings.gripper_center if self._saved is None else None
        return done


@mutant("late-initial-positions-are-lost", "4.21/3", subtle=True)
class LosesLateInitialPositions(_CountsRequests):
    """After three hundred requests an initial position is answered 1 but not stored."""

    def set_initial_tool_position(self, request: Request) -> bool:
        before = self.store.settings.initial_tool_position
        done = super().set_initial_tool_position(request)
        if self._is_late:
            self.save(initial_tool_position=before)
        return done


@mutant("second-login-sets-the-clock-back", "4.5/4", subtle=True)
class SecondLoginSetsClockBack(ControllerCore):
    """A second login on a connection undoes changes of the clock since the first."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._first: dict[int, tuple[datetime, float]] = {}

    def login(self, request: Request) -> bool:
        connection, clock = request.session.connection, self.plant.clock
        if request.session.logged_in and connection in self._first:
            time, then_s = self._first[connection]
            clock.set(time + timedelta(seconds=request.now_s - then_s), request.now_s)
        else:
            self._first[connection] = clock.time(request.now_s), request.now_s
        return super().login(request)


@mutant("mistaken-password-blocks-the-next", "4.2/2", subtle=True)
class RefusesChangeAfterMistake(ControllerCore):
    """After a change with a wrong old password, the next change with the right one is refused."""

    _mistaken = False

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        if old == self.store.settings.password and self._mistaken and new != old:
            self._mistaken = False
            return False
        self._mistaken = old != self.store.settings.password
        return super().set_password(request)


# ---------------------------------------------------------------------- programs


@mutant("refused-run-is-told", "4.9/4", subtle=True)
class ReportsRefusedRun(ControllerCore):
    """After a run is refused because another one executes, its name is reported as running."""

    _wrong = b""

    def run_program(self, request: Request) -> Acceptance:
        task = self.robot.task
        if task is None:
            self._wrong = b""
        elif task.program and request.value in self.store:
            self._wrong = request.value
        return super().run_program(request)

    def get_running_program(self, request: Request) -> RunningProgram | None:
        running = super().get_running_program(request)
        return running._replace(name=self._wrong) if running and self._wrong else running


@mutant("stopped-simulation-undoes-the-setting", "4.32/6", subtle=True)
class StoppedSimulationResetsOutput(ControllerCore):
    """Stopping a simulation undoes the last setting of an output, even of a client."""

    _former: PortValue | None = None

    def set_digital_output(self, request: Request) -> bool:
        port, outputs = request.value.port, self.get_digital_outputs(request)
        if done := super().set_digital_output(request):
            self._former = PortValue(port, int(outputs[-port]))
        return done

    def emergency_stop(self, request: Request) -> Acceptance:
        task, former = self.robot.task, self._former
        if task is not None and task.state == "02" and former:
            self.plant.digital_outputs[former.port] = bool(former.value)
        return super().emergency_stop(request)


@mutant("late-runs-miss-their-program", "4.15/4", subtle=True)
class LateRunsMissProgram(_CountsRequests):
    """After three hundred requests a program that was deleted and uploaded again is not found."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._deleted: set[bytes] = set()

    def delete_program(self, request: Request) -> bool:
        self._deleted.add(request.value)
        return super().delete_program(request)

    def run_program(self, request: Request) -> Acceptance:
        if self._is_late and request.value in self._deleted:
            request = replace(request, value=b"gone.rob")
        return super().run_program(request)
