"""Behaviour of the program commands: 4.9 to 4.13, 4.15, 4.16."""

from collections.abc import Iterator
from typing import Final

from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.protocol.program_files import Program, ProgramError, parse
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, SILENCE, Base, Silence, refused
from scaraspec.virtual_controller.interpreter import Run, runnable
from scaraspec.virtual_controller.robot import RUNNING, SIMULATING, Task
from scaraspec.virtual_controller.session import Request

NO_SUCH_PROGRAM: Final = "20"
"""Code for a program that does not exist (L1044)."""
LIST_MAX_BYTES: Final = 253
"""Limit of the names and bars in one part of a list, after ``1|`` (L246)."""


def list_parts(names: list[bytes]) -> Iterator[NameListPart]:
    """Split a list between names into parts of at most 255 bytes (A-4.10-3)."""
    part: list[bytes] = []
    size_bytes = 0
    for name in names:
        if part and size_bytes + 1 + len(name) > LIST_MAX_BYTES:
            yield NameListPart(more=True, names=tuple(part))
            part, size_bytes = [], 0
        size_bytes += len(name) + (1 if part else 0)
        part.append(name)
    yield NameListPart(more=False, names=tuple(part))


class Programs(Base):
    """The commands for user programs.

    Attributes:
        interpreter: The class that runs a program.
    """

    interpreter: type[Run] = Run

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """4.9: the running or simulated program and its run time (A-4.9-4)."""
        task = self.robot.task
        if task is None or not task.program:
            return None
        return RunningProgram(task.program, int(request.now_s - task.request.now_s))

    def list_programs(self, request: Request) -> NameListPart:
        """4.10: all programs, sorted; further parts are pushed or requested (A-4.10-3)."""
        names = [name for name in self.store.names() if self.is_program(name)]
        first, *rest = request.session.remaining_list_parts or list_parts(names)
        if self.dialect["list_cont"] == "push":
            for part in rest:
                data = request.command.reply.encode(part, self.dialect)
                self.send_after_reply(request.session, Frame(C2A, request.frame.opcode, data))
            rest = []
        request.session.remaining_list_parts = rest
        return first

    def delete_program(self, request: Request) -> bool:
        """4.11: refused while the file runs or is transferred; may be the default (A-4.11-1)."""
        name: bytes = request.value
        if self.dialect["delete_guard"] == "refuse" and self.is_in_use(name):
            return False
        if not self.remove(name):
            return False
        if name == self.store.settings.default_program:
            self.save(default_program=b"")
        return True

    def is_in_use(self, name: bytes) -> bool:
        """Whether the program runs or is being transferred."""
        transfers = (session.transfer for session in self.sessions.values())
        task = self.robot.task
        return (task is not None and task.program == name) or any(
            transfer is not None and transfer.name == name for transfer in transfers
        )

    def get_default_program(self, _: Request) -> bytes | Silence:
        """4.12: no name if no default program is set or it was deleted (A-4.12-2)."""
        name = self.store.settings.default_program
        if self.is_program(name):
            return name
        return SILENCE if self.dialect["default_none"] == "silence" else b""

    def set_default_program(self, request: Request) -> bool:
        """4.13: must be a stored program (A-4.13-1); does not start it (A-4.12-3)."""
        return self.is_program(request.value) and self.save(default_program=request.value)

    def run_program(self, request: Request) -> Acceptance:
        """4.15: refused if the robot is busy, has a fault or cannot run the program."""
        return self._start(request, RUNNING)

    def simulate_program(self, request: Request) -> Acceptance:
        """4.16: nothing moves and no output is set (A-4.16-1)."""
        return self._start(request, SIMULATING)

    def _start(self, request: Request, state: str) -> Acceptance:
        simulated = state == SIMULATING
        if code := self.robot.refusal_code(moves=not simulated):
            return refused(code)
        program = self._program(request.value)
        if program is None:
            return refused(NO_SUCH_PROGRAM)
        run = self.interpreter(
            program, self.dialect, self.plant, simulated=simulated, now_s=request.now_s
        )
        self.robot.task = Task(request, state, run, program=request.value)
        return ACCEPTED

    def _program(self, name: bytes | None) -> Program | None:
        """Return a program that may run, or None."""
        if name is None or not self.is_program(name):
            return None
        return self.parse_program(self.store.read(name))

    def parse_program(self, data: bytes) -> Program | None:
        """Return the program of a file; None if it is damaged or not runnable (A-4.15-2)."""
        try:
            program = parse(data)
        except ProgramError:
            return None
        return program if runnable(program, self.dialect) else None
