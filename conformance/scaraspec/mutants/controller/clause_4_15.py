"""Mutants of clause 4.15: running a program."""

from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, outcome, sent_frame
from scaraspec.mutants.operators.controller.requests import (
    accepts,
    after,
    before,
    completes,
    completes_refused,
)
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.program_files import Program
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE, RUNNING
from scaraspec.virtual_controller.session import Request


def _refusal(change: Callable[[bytes], bytes]) -> Core:
    """The code in the refusal of a run is replaced by a function of it."""
    return first_reply(
        "run_program",
        lambda data: b"0" + change(data[2:]) if data.startswith(b"0|") else data,
    )


def _finds(find: Callable[[ControllerCore, bytes], bytes | None]) -> Core:
    """Another program is run or simulated, or none."""

    class Finds(ControllerCore):
        def _program(self, name: bytes | None) -> Program | None:
            return super()._program(None if name is None else find(self, name))

    return Finds


def _is_result(frame: Frame) -> bool:
    return frame.opcode == 0x30 and frame.tagged


def _runs_despite_fault(core: ControllerCore, _request: Request) -> bool:
    return core.plant.fault_code is not None and core.robot.task is None


def _is_upload(core: ControllerCore, request: Request) -> bool:
    transfers = (session.transfer for session in core.sessions.values())
    names = [transfer.name for transfer in transfers if transfer is not None]
    return request.value in names and core.robot.task is None


def _runs_already(core: ControllerCore, request: Request) -> bool:
    return core.robot.task is not None and core.robot.task.program == request.value


def _refuse_accepted(core: ControllerCore, _request: Request, reply: Acceptance) -> Acceptance:
    if not reply.accepted:
        return reply
    core.robot.task = None
    return refused("20")


def _drop_other_program(core: ControllerCore, request: Request) -> None:
    task = core.robot.task
    if task is not None and task.program and task.program != request.value:
        core.robot.task = None


def _drop_other_session(core: ControllerCore, request: Request) -> None:
    task = core.robot.task
    if task is not None and task.request.session is not request.session:
        core.robot.task = None


row(
    "runs-before-it-looks",
    "4.15/2 4.15/7",
    "The run of a missing program is accepted and reported as done.",
    completes_refused("run_program", "20"),
)
row(
    "runs-despite-fault",
    "4.15/2",
    "A run during a motor fault is accepted and reported as done.",
    completes("run_program", _runs_despite_fault),
)


@mutant("runs-what-it-has-refused", "4.15/2", subtle=True)
class ReportsRefusedRun(ControllerCore):
    """The run of a missing program is refused but the status is 01 for 0.1 s."""

    _until_s = -1.0

    def run_program(self, request: Request) -> Acceptance:
        reply = super().run_program(request)
        if reply.code == "20":
            self._until_s = request.now_s + 0.1
        return reply

    def get_status(self, request: Request) -> str:
        return RUNNING if request.now_s < self._until_s else super().get_status(request)


row(
    "refuses-run-in-one-byte",
    "4.15/3",
    "The refusal of a run has no code.",
    _refusal(lambda _code: b""),
)
row(
    "refuses-run-with-number",
    "4.15/3",
    "The code in the refusal of a run is a number in one byte.",
    _refusal(lambda code: b"|" + bytes.fromhex(code.decode())),
)
row(
    "runs-nothing",
    "4.15/4",
    "Every run is refused with the code of a missing program.",
    after("run_program", _refuse_accepted),
)
row(
    "accepts-run-with-its-name",
    "4.15/4",
    "The first reply to a run is 1, followed by a bar and a name.",
    first_reply("run_program", {b"1": b"1|zs.rob"}),
)
row(
    "runs-short-names-alone",
    "4.15/4",
    "A program whose name has more than sixteen bytes cannot be run.",
    _finds(lambda _core, name: None if len(name) > 16 else name),
    subtle=True,
)


@mutant("runs-program-once", "4.15/4", subtle=True)
class RunsProgramOnce(ControllerCore):
    """The second run of the same name is refused."""

    _ran: tuple[bytes, ...] = ()

    def _program(self, name: bytes | None) -> Program | None:
        if name is None or name in self._ran:
            return None
        self._ran = (*self._ran, name)
        return super()._program(name)


row(
    "run-has-no-result",
    "4.15/5",
    "A completed run sends no final result.",
    outcome("run_program", lambda _core, _request, ended: None if ended.done else ended),
)
row(
    "run-ends-untagged",
    "4.15/5",
    "The final result of a run has no tag.",
    sent_frame(_is_result, tagged=False),
)
row(
    "run-ends-under-its-neighbour",
    "4.15/5",
    "The final result of a run has the opcode of the simulation.",
    sent_frame(_is_result, opcode=0x31),
)


@mutant("run-ends-at-once", "4.15/5", "4/15")
class EndsRunAtOnce(ControllerCore):
    """The final result of a run is sent with the first reply; the program continues."""

    _is_sent = False

    def run_program(self, request: Request) -> Acceptance:
        reply = super().run_program(request)
        if reply.accepted:
            self.send_result(request, DONE)
            self._is_sent = True
        return reply

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name == "run_program" and self._is_sent:
            self._is_sent = False
        else:
            super().send_result(request, outcome)


row(
    "good-run-fails",
    "4.15/5",
    "A completed run is reported as failed.",
    outcome(
        "run_program",
        lambda _core, _request, ended: Outcome(done=False, code="05") if ended.done else ended,
    ),
)
row(
    "runs-the-nearest-name",
    "4.15/7",
    "The beginning of a name runs the first program with this beginning.",
    _finds(
        lambda core, name: next(
            (stored for stored in core.store.names() if name and stored.startswith(name)), name
        )
    ),
)
row(
    "runs-the-beginning-of-name",
    "4.15/7",
    "Bytes after the name of a started program are ignored.",
    _finds(
        lambda core, name: next(
            (stored for stored in core.store.names() if name.startswith(stored)), name
        )
    ),
)
row(
    "adds-the-extension",
    "4.15/7",
    "A name without extension runs the program with the extension .rob.",
    _finds(lambda _core, name: name if b"." in name else name + b".rob"),
)


@mutant("runs-deleted-programs", "4.15/7")
class RunsDeletedPrograms(ControllerCore):
    """A program that was run can be run again after its deletion."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._loaded: dict[bytes, Program] = {}

    def _program(self, name: bytes | None) -> Program | None:
        program = super()._program(name) or self._loaded.get(name or b"")
        if program is not None and name is not None:
            self._loaded[name] = program
        return program


row(
    "runs-what-was-only-named",
    "4.15/7",
    "The run of a program that is being transferred is accepted and reported as done.",
    completes("run_program", _is_upload),
)
row(
    "missing-program-is-position-fault",
    "4.15/7",
    "A missing program is refused with 05.",
    first_reply("run_program", {b"0|20": b"0|05"}),
)
row(
    "second-run-replaces-the-first",
    "4.15/8 4/6",
    "A run of another program replaces the running program.",
    before("run_program", _drop_other_program),
)
row(
    "same-run-is-accepted-again",
    "4.15/8",
    "A second run of the running program is accepted and ignored.",
    accepts("run_program", _runs_already),
)
row(
    "second-client-runs",
    "4.15/8",
    "A run on another connection replaces the running program.",
    before("run_program", _drop_other_session),
)
