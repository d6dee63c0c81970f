"""Controllers with mistakes that other programmers made, and that were once overlooked, are failed.

Each by a case of a requirement that it violates.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from functools import cached_property
from typing import Any, ClassVar

import pytest

from scaraspec.controller import interpreter, motion
from scaraspec.controller.behaviour import SILENCE
from scaraspec.controller.behaviour.base import ACCEPTED, Silence
from scaraspec.controller.brain import Brain
from scaraspec.controller.faults.breaking import OtherInlet
from scaraspec.controller.faults.transferring import SendsAfterTheEnd
from scaraspec.controller.inlet import Inlet
from scaraspec.controller.robot import DONE, Task
from scaraspec.controller.session import Action, Request, Session
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.commands import Point, RunningProgram
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Found, Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, NameListPart
from scaraspec.protocol.programs import (
    NodeType,
    Operation,
    Opt,
    Program,
    ResultType,
    ValueType,
)

Try = Callable[..., Any]


class OldTimeOut(SendsAfterTheEnd):
    """The time-out of a transfer that has come to its end goes on, and ends the next one."""

    @cached_property
    def due_s(self) -> dict[int, float]:
        """When the last transfer of each connection would have been given up."""
        return {}

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whatever it was
        """Forget to stop the timer."""
        self.due_s[session.connection] = self._handled_s + 30

    downloaded = uploaded

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Give up what is under way."""
        self._handled_s = now_s
        if now_s > self.due_s.get(session.connection, math.inf):
            del self.due_s[session.connection]
            self.abandon(session)
        super().handle(session, frame, now_s)


class _Restarts(Inlet):
    """Takes a segment that begins with AA for a new frame."""

    def receive(self, data: bytes, now_s: float) -> list[Found]:
        """Forget the old one."""
        if data.startswith(b"\xaa"):
            self._framer = self._new_framer()
        return super().receive(data, now_s)


class SegmentIsFrame(OtherInlet):
    """What begins with AA begins a frame, wherever that is."""

    inlet = _Restarts


class _FullBuffer(Inlet):
    """Reads 256 bytes at once, and has no room for these behind what it has kept."""

    def receive(self, data: bytes, now_s: float) -> list[Found]:
        """Forget the beginning of a frame where a whole buffer follows it."""
        found: list[Found] = []
        for begin in range(0, len(data), 256):
            part = data[begin : begin + 256]
            if len(part) == 256:
                self._framer = self._new_framer()
            found += super().receive(part, now_s)
        return found


class FullBuffer(OtherInlet):
    """Where one buffer ends inside of a frame, and another is full, the frame is lost."""

    inlet = _FullBuffer


class _FewPieces(Inlet):
    """Puts a frame together of eight pieces."""

    pieces = 0

    def receive(self, data: bytes, now_s: float) -> list[Found]:
        """Give it up at the ninth."""
        self.pieces += 1
        if self.pieces > 8:
            self._framer, self.pieces = self._new_framer(), 0
        found = super().receive(data, now_s)
        if found:
            self.pieces = 0
        return found


class FewPieces(OtherInlet):
    """What comes in more than eight pieces is no frame."""

    inlet = _FewPieces


class HalfAKilobyte(Brain):
    """Of a segment of more than 512 bytes the rest is lost."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Cut it off."""
        return super().receive(connection, data[:512], now_s)


class ShortestText(Brain):
    """Numbers are told as the programming language writes them."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write them so."""
        if frame.opcode == 0x34:
            numbers = self.store.settings.gripper_center
            frame = frame._replace(data="|".join(map(str, numbers)).encode())
        super().emit(session, frame)


class StopsForAnyone(Brain):
    """Whoever leaves takes along what another client has begun, and nobody is told."""

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Stop it."""
        self.robot.stop(now_s)
        return super().close(connection, now_s)


class DiesWithItsClient(Brain):
    """A program whose result nobody is there to hear is never over."""

    def _settle(self, now_s: float) -> None:
        task = self.robot.task
        if task is None or task.request.session.connection in self.sessions:
            super()._settle(now_s)


class OneByteTooMany(Brain):
    """A part of the list may have 256 bytes, of which its length byte says 0."""

    def list_programs(self, request: Request) -> NameListPart | Silence:
        """Send it."""
        data = b"|".join((b"0", *self.store.names()))
        if len(data) != 256:
            return super().list_programs(request)
        self.transmit(request.session, b"\xcc\x0b\x00" + data + b"\xaa")
        return SILENCE


class HidesWhatRuns(Brain):
    """The program that runs is not in the list."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        task = self.robot.task
        return super().is_program(name) and (task is None or task.program != name)


class HidesItsDefault(Brain):
    """The default program is not in the list."""

    def list_programs(self, request: Request) -> NameListPart:
        """Leave it out."""
        part = super().list_programs(request)
        hidden = self.store.settings.default_program
        return part._replace(names=tuple(name for name in part.names if name != hidden))


class ForgetsItsDefault(Brain):
    """Whichever program is deleted, there is no default one any more."""

    def delete_program(self, request: Request) -> bool:
        """Forget it."""
        deleted: bool = super().delete_program(request)
        if deleted:
            self.save(default_program=b"")
        return deleted


class OneProgram(Brain):
    """The default program and the one that was run last are the same."""

    def run_program(self, request: Request) -> Acceptance:
        """Make it the default one."""
        answer = super().run_program(request)
        if answer is ACCEPTED:
            self.save(default_program=request.value)
        return answer


class LatestProgram(SendsAfterTheEnd):
    """The program that was uploaded last is the default one."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sent it
        """Make it so."""
        self.save(default_program=name)


class NamesNoDefaultMeanwhile(Brain):
    """While a program runs another default program is answered "1", and forgotten."""

    def set_default_program(self, request: Request) -> bool:
        """Forget it."""
        return self.robot.task is not None or super().set_default_program(request)


class StopsItsClock(Brain):
    """While a program runs the clock stands still."""

    stopped: datetime | None = None

    def get_time(self, request: Request) -> datetime:
        """Tell when it began."""
        time = super().get_time(request)
        self.stopped = self.robot.task and (self.stopped or time)
        return self.stopped or time


class NeverForgets(Brain):
    """While the arm jogs the last program is told to run."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Mistake every task for a run."""
        idle = self.robot.task is None
        return super().get_running_program(request) or (None if idle else RunningProgram(b"a", 1))


class SumsItUp(Brain):
    """Of a password it has kept nothing but the sum of its bytes."""

    def login(self, request: Request) -> bool:
        """Compare that."""
        right = sum(request.value) == sum(self.store.settings.password)
        request.session.logged_in |= right
        return right


class _OutputsLast(Inlet):
    """Settings of outputs wait until the rest of a segment has been served."""

    def receive(self, data: bytes, now_s: float) -> list[Found]:
        """Put them behind it."""
        found = super().receive(data, now_s)
        return sorted(found, key=lambda each: isinstance(each, Frame) and each.opcode == 0x43)


class OutputsLast(OtherInlet):
    """The outputs have a task of their own, which comes later than that which answers."""

    inlet = _OutputsLast


class NothingToRelease(Brain):
    """A release of joints that are released is accepted, and never ends."""

    released = False

    def emit(self, session: Session, frame: Frame) -> None:
        """Forget the second end."""
        if frame.tagged and frame.opcode == 0x3A and self.released:
            return
        if frame.tagged and frame.opcode in (0x3A, 0x3B):
            self.released = frame.opcode == 0x3A
        super().emit(session, frame)


class NoAnglesOnTheWay(Brain):
    """While the arm jogs its angles are not told."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave them out."""
        task = self.robot.task
        if frame.opcode != 0x3C or task is None or not task.needs_link:
            super().emit(session, frame)


class HalfAsLong(Brain):
    """Programs are told to have run for half as long as they have."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Halve it."""
        told = super().get_running_program(request)
        return told and told._replace(run_time_s=told.run_time_s // 2)


class VersionOfARun(Brain):
    """The text of the version is made where the name of a program was put."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Show the one for the other."""
        task = self.robot.task
        if frame.opcode == 0x08 and task is not None and task.program:
            frame = frame._replace(data=task.program)
        super().emit(session, frame)


class SixteenLetters(Brain):
    """Names are compared by their first 16 bytes."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take another name for the one that is asked for."""
        if frame.opcode in self.opcodes and frame.data not in self.store:
            like = [name for name in self.store.names() if name[:16] == frame.data[:16]]
            frame = frame._replace(data=(like or [frame.data])[0])
        super().handle(session, frame, now_s)

    opcodes = frozenset({0x30, 0x0C})


class SixteenNew(SixteenLetters):
    """So they are where a new one is asked for."""

    opcodes = frozenset({0x50})


class SixteenKilobytes(Brain):
    """What is longer than a buffer is no program, and is not listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        return super().is_program(name) and len(self.store.read(name)) <= 16_384


class OthersRun(Brain):
    """Whoever is refused because another client has begun something is told that it is a run."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell another state."""
        task = self.robot.task
        if task is not None and task.request.session is not session and frame.data[:2] == b"0|":
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


class LimitedTenths(Brain):
    """Numbers are kept as tenths in 16 bits."""

    def set_gripper_center(self, request: Request) -> bool:
        """Cut them off."""
        value = request.value and Point(*(min(each, 3276.7) for each in request.value))
        return super().set_gripper_center(replace(request, value=value))


class OneBuffer(Brain):
    """What a program does is written where a chunk is made."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Spoil it."""
        task = self.robot.task
        if frame.opcode == 0x56 and task is not None and task.program:
            frame = frame._replace(data=frame.data[:-1] + b"\1")
        super().emit(session, frame)


class SmallLetters(Brain):
    """The program that runs is told in small letters."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Change them."""
        told = super().get_running_program(request)
        return told and told._replace(name=told.name.lower())


class MovesOnARun(Brain):
    """While a program moves the arm its status is that of a move."""

    heard_s = 0.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Note when."""
        self.heard_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        moves = self.plant.motion_ends_s > self.heard_s
        if frame.opcode == 0x09 and self.robot.task is not None and moves:
            frame = frame._replace(data=b"04")
        super().emit(session, frame)


class EndsItsMove(Brain):
    """An emergency stop ends a program, and not the move that it has begun."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let the arm go on."""
        task, plant = self.robot.task, self.plant
        motion, began_s = plant._motion, plant._began_s
        answer = super().emergency_stop(request)
        if task is not None and task.program:
            plant._motion, plant._began_s = motion, began_s
        return answer


class GoesOn(Brain):
    """A program that was stopped goes on from there when it is run again."""

    last: interpreter.Run | None = None

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Begin where it was."""
        answer = super().run_program(request)
        task, last = self.robot.task, self.last
        if answer is ACCEPTED and task is not None and isinstance(task.act, interpreter.Run):
            self.last = task.act
            if last is not None and last.outcome is None and last._program == task.act._program:
                task.act._index = last._index
        return answer


class WaitsOn(Brain):
    """A program behind one that was stopped has half a second of its waits behind it already."""

    last: interpreter.Run | None = None

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Begin earlier."""
        answer = super().run_program(request)
        task, last = self.robot.task, self.last
        if answer is ACCEPTED and task is not None and isinstance(task.act, interpreter.Run):
            self.last = task.act
            if last is not None and last.outcome is None:
                task.act.next_event_s -= 0.5
        return answer


class StopsLater(Brain):
    """A stop that is not needed stops what begins next."""

    stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        """Keep it."""
        answer = super().emergency_stop(request)
        self.stopped = not answer.accepted
        return answer

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Obey it."""
        answer = super().run_program(request)
        if answer is ACCEPTED and self.stopped and isinstance(self.robot.task, Task):
            self.stopped = False
            task = self.robot.stop(request.now_s)
            assert task is not None
            self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
            self.conclude(task.request, task.stopped)
            return SILENCE
        return answer


class BusyLater(Brain):
    """Only at the next instant it knows that a command executes."""

    def lock_joints(self, request: Request) -> Acceptance | Silence:
        """Lock the joints all the same."""
        task = self.robot.task
        if task is None or task.request.now_s != request.now_s:
            return super().lock_joints(request)
        self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
        self.conclude(request, DONE)
        return SILENCE


class SilenceByTheClock(Brain):
    """Takes the time of day for the time that passes: an upload ends when the clock is set."""

    def set_time(self, request: Request) -> bool:
        """Give up what has lasted for so long."""
        self.abandon(request.session)
        was_set: bool = super().set_time(request)
        return was_set


class DeletesUploads(Brain):
    """A deletion ends the uploads that are under way."""

    def delete_program(self, request: Request) -> bool:
        """End them."""
        for session in self.sessions.values():
            self.abandon(session)
        return super().delete_program(request)


class TellsItsDefault(Brain):
    """The program that runs is told to be the default one, where there is one."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell that name."""
        default = self.store.settings.default_program
        if frame.opcode == 0x0A and default and frame.data.startswith(b"1|"):
            frame = frame._replace(data=b"|".join((b"1", default, frame.data[-8:])))
        super().emit(session, frame)


class LongFilesReachOver(SendsAfterTheEnd):
    """A file of more than 50,000 bytes is written over the beginning of the one before."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Spoil it."""
        before = max((other for other in self.store.names() if other < name), default=b"")
        if before and len(self.store.read(name)) > 50_000:
            content = self.store.read(before)
            self.remove(before)
            self.store.write(before, b"!" + content[1:])


class _OneBuffer(interpreter.Run):
    """What was sent last is what runs on."""

    latest: ClassVar[Program | None] = None

    def _step(self, now_s: float) -> None:
        if self.latest is not None:
            self._program, type(self).latest = self.latest, None
        super()._step(now_s)


class RunsWhatComes(SendsAfterTheEnd):
    """A program that is sent while another one runs takes its place in memory."""

    interpreter = _OneBuffer

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Let it."""
        if self.robot.task is not None:
            _OneBuffer.latest = self.understood(self.store.read(name))


class _InPlace(interpreter.Run):
    """Writes A into the result before it looks at B."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type == ResultType.CALCULATION:
            a, _ = self._operands(operation)
            self._variables[operation.result] = a
            operation = replace(operation, value_a_type=ValueType.NUMBER, value_a=a)
        super()._compute(operation)


class InPlace(Brain):
    """A controller whose programs do."""

    interpreter = _InPlace


class SameLetters(Brain):
    """Names are told apart by the sum of their characters."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take one for the other."""
        if frame.opcode in (0x0C, 0x54):
            like = (name for name in self.store.names() if sorted(name) == sorted(frame.data))
            frame = frame._replace(data=next(like, frame.data))
        super().handle(session, frame, now_s)


class DefaultPlace(SendsAfterTheEnd):
    """The default program is a place in the store: who comes to it next inherits it."""

    heir = False

    def delete_program(self, request: Request) -> bool:
        """Leave the place."""
        before = self.store.settings.default_program
        deleted: bool = super().delete_program(request)
        self.heir = self.heir or (deleted and before == request.value)
        return deleted

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Take it."""
        if self.heir:
            self.heir = False
            self.save(default_program=name)


class ShortNamesHideLong(Brain):
    """A program whose name begins as another's is not listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        stems = (other.rpartition(b".")[0] for other in self.store.names() if other != name)
        return super().is_program(name) and not any(name.startswith(stem) for stem in stems)


class ThirtyTwo(Brain):
    """No more than 32 programs are listed."""

    def is_program(self, name: bytes) -> bool:
        """Whether it is listed."""
        return super().is_program(name) and name in self.store.names()[:32]


class SmallPasswords(Brain):
    """New passwords are kept in small letters."""

    def set_password(self, request: Request) -> bool:
        """Change them."""
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new.lower()))
        return super().set_password(request)


class PasswordBuffer(Brain):
    """New passwords are cut to what a buffer of 64 bytes holds."""

    def set_password(self, request: Request) -> bool:
        """Cut it."""
        value = request.value
        if value is not None:
            request = replace(request, value=value._replace(new=value.new[:63]))
        return super().set_password(request)


class LiteralsOfALanguage(Brain):
    """An initial tool position is read by what reads the literals of some language."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Understand them."""
        if frame.opcode == 0x36:
            fields = [b"0" if f in (b"NaN", b"Infinity") else f for f in frame.data.split(b"|")]
            frame = frame._replace(data=b"|".join(f.removesuffix(b"f") for f in fields))
        super().handle(session, frame, now_s)


class _Overlooks(Brain):
    """Of a gripper centre it overlooks something in the numbers."""

    overlooked = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take it away."""
        if frame.opcode == 0x35:
            frame = frame._replace(data=re.sub(self.overlooked, b"", frame.data))
        super().handle(session, frame, now_s)


def overlooks(pattern: bytes) -> type[Brain]:
    """A controller that does."""
    return type("Overlooks", (_Overlooks,), {"overlooked": pattern})


class Boundless(Brain):
    """An initial tool position that was never set is what the memory held."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        if frame.opcode == 0x37:
            frame = frame._replace(data=b"|".join([b"%.1f" % 3.4e38] * 6))
        super().emit(session, frame)


class Absurd(Brain):
    """What it tells under one opcode is nothing that anybody could have set."""

    opcode = 0
    data = b""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        if frame.opcode == self.opcode:
            frame = frame._replace(data=self.data)
        super().emit(session, frame)


class JogsNowhere(Brain):
    """A jog is accepted, and lasts until it is stopped, and the arm stays where it is."""

    def jog(self, request: Request) -> Acceptance:
        """Hold the arm."""
        answer = super().jog(request)
        still = replace(motion.hold(self.plant.joints(request.now_s)), duration_s=60.0)
        self.plant.start(still, request.now_s)
        return answer


class SixteenBits(Brain):
    """Where a move goes is kept in whole millimetres of 16 bits."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Cut it off."""
        target = request.value
        if target is not None:
            target = target._replace(x=(target.x + 2**15) % 2**16 - 2**15)
        return super().set_tool_coordinates(replace(request, value=target))


class _NoNesting(interpreter.Run):
    """Jumps from an IF or ELSE to the next marker of the kind of its partner, whosever that is."""

    ways: Sequence[tuple[NodeType, NodeType]] = ()

    def _partner(self) -> int:
        partner, nodes = super()._partner(), self._program.nodes
        way = nodes[self._index].type, nodes[partner].type
        if way not in self.ways:
            return partner
        return next(n for n in range(self._index + 1, len(nodes)) if nodes[n].type is way[1])


def no_nesting(begin: NodeType, end: NodeType) -> type[Brain]:
    """A controller whose programs jump so."""
    run = type("Run", (_NoNesting,), {"ways": [(begin, end)]})
    return type(f"{begin.name.title()}To{end.name.title()}", (Brain,), {"interpreter": run})


class _FromTheBeginning(interpreter.Run):
    """Returns from the end of a loop to the first node of the program."""

    def _repeat(self, start: int) -> None:  # noqa: ARG002 - wherever it starts
        self._index = -1


class FromTheBeginning(Brain):
    """A controller whose programs do."""

    interpreter = _FromTheBeginning


class _Subtracts(interpreter.Run):
    """Compares by the sign of the difference, as far as 32 bits hold it."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt >= Opt.GREATER:
            return (a - b + 2**31) % 2**32 - 2**31, 0
        return a, b


class Subtracts(Brain):
    """A controller whose programs do."""

    interpreter = _Subtracts


class _ComparesWithTheKey(interpreter.Run):
    """Compares with the key of a variable, where that is the second operand."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return a, operation.value_b if operation.opt >= Opt.GREATER else b


class ComparesWithTheKey(Brain):
    """A controller whose programs do."""

    interpreter = _ComparesWithTheKey


class KeepsPrograms(Brain):
    """What a program does is found out once for each name."""

    @cached_property
    def programs(self) -> dict[bytes, Program]:
        """What was found out."""
        return {}

    def _program(self, name: bytes) -> Program | None:
        program = super()._program(name)
        return program and self.programs.setdefault(name, program)


class PointBehind(Brain):
    """An address may have a point behind it."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Overlook it."""
        if frame.opcode == 0x05:
            frame = frame._replace(data=frame.data.replace(b".|", b"|"))
        super().handle(session, frame, now_s)


@pytest.mark.parametrize(
    ("brain", "requirement"),
    [
        (SumsItUp, "4.1/3"),
        (OutputsLast, "3/30"),
        (NothingToRelease, "4.25/3"),
        (NoAnglesOnTheWay, "3/31"),
        (SixteenLetters, "4.15/7"),
        (SixteenLetters, "4.11/4"),
        (SixteenKilobytes, "4.10/11"),
        (OthersRun, "4/15"),
        (PointBehind, "4.4/5"),
        (no_nesting(NodeType.IF, NodeType.ELSE), "6.5/24"),
        (no_nesting(NodeType.IF, NodeType.ENDIF), "6.5/24"),
        (no_nesting(NodeType.ELSE, NodeType.ENDIF), "6.5/24"),
        (FromTheBeginning, "6.5/23"),
        (WaitsOn, "6.5/20"),
        (KeepsPrograms, "6.5/19"),
        (KeepsPrograms, "6.5/24"),
        (StopsLater, "4.15/5"),
        (SilenceByTheClock, "5.4/8"),
        (DeletesUploads, "5.4/8"),
        (TellsItsDefault, "4.9/4"),
        (LongFilesReachOver, "5.2/12"),
        (RunsWhatComes, "6.5/19"),
        (InPlace, "6.6a/14"),
        (SameLetters, "4.11/4"),
        (SameLetters, "5.3/3"),
        (DefaultPlace, "4.12/4"),
        # The characters on both sides of the digits are none, and no sign stands behind them.
        (overlooks(rb"/"), "4.20/4"),
        (overlooks(rb":"), "4.20/4"),
        (overlooks(rb"-(?=\||$)"), "4.20/4"),
        (SixteenBits, "4.24/9"),
        (GoesOn, "6.5/26"),
        (ShortNamesHideLong, "4.10/11"),
        (ThirtyTwo, "4.10/11"),
        (SmallLetters, "4.9/4"),
        (OneBuffer, "5.2/12"),
        (LimitedTenths, "4.20/3"),
        (VersionOfARun, "4.7/4"),
        (HalfAsLong, "4.9/5"),
        (HidesWhatRuns, "4.10/11"),
        (StopsItsClock, "4.6/4"),
        (NeverForgets, "4.9/6"),
        (OldTimeOut, "5.4/5"),
        (OldTimeOut, "5.3/7"),
        (SegmentIsFrame, "2/5"),
        (FewPieces, "2/5"),
        (FullBuffer, "2/6"),
        (HalfAKilobyte, "2/6"),
        (OneByteTooMany, "4.10/9"),
        (ShortestText, "T/5"),
        (Boundless, "4.21/3"),
        (Subtracts, "6.6a/12"),
        (ComparesWithTheKey, "6.6a/14"),
        (LiteralsOfALanguage, "4.21/4"),
        (SmallPasswords, "4.2/4"),
        (PasswordBuffer, "4.2/4"),
    ],
)
def test_it_is_found(tried: Try, brain: type[Brain], requirement: str) -> None:
    """A case of the requirement fails."""
    assert requirement in tried(brain, requirement, examples=1).failed


@pytest.mark.parametrize(
    ("brain", "only", "requirement"),
    [
        # Names that differ only at their end are those of different files.
        (SixteenNew, "4.10/4", "5.2/2"),
        # While a program moves the arm a program runs, and behind a stop the arm stands then, too.
        (MovesOnARun, "6.5/25", "4.8/4"),
        (EndsItsMove, "6.5/25", "4.17/7"),
        # A program is listed as long as it is stored, also while it is the default one.
        (HidesItsDefault, "4.13/3", "4.10/11"),
        # It is the default one until another is named, whatever is deleted or run since.
        (ForgetsItsDefault, "4.12/4", "4.13/3"),
        (NamesNoDefaultMeanwhile, "4.13/6", "4.13/3"),
        (OneProgram, "4.13/6", "4.13/3"),
        # A robot is busy from the request on, not from its next look at what it does.
        (BusyLater, "3/30", "4/6"),
        # Whether a robot is free again is seen by a case that accepts runs, too.
        (DiesWithItsClient, "4.15/4", "4/15"),
        # What one client has begun ends with a result, whoever else comes and goes.
        (StopsForAnyone, "4.17/6", "4.15/5"),
    ],
)
def test_it_is_found_by_another(
    tried: Try, brain: type[Brain], only: str, requirement: str
) -> None:
    """A case of one requirement fails for another one, which is violated."""
    assert requirement in tried(brain, only, examples=1).failed


def test_who_takes_the_latest_program_for_the_default_one_is_found(tried: Try) -> None:
    """It is found without any motion, too: the default program is the one that was named."""
    allowed = (Hazard.READ_ONLY, Hazard.STATE)
    assert "4.13/3" in tried(LatestProgram, "4.13/3", allowed=allowed).failed


def test_a_jog_that_moves_nothing_is_not_called_right(tried: Try) -> None:
    """Nor is it a mistake: towards an end of its travel the arm may stay."""
    directions = tried(JogsNowhere, "4.28/3")
    assert {case.verdict for case in directions.values()} == {Verdict.NONE}


@pytest.mark.parametrize(
    ("opcode", "data"),
    [
        (0x07, b"99991231235959"),
        (0x07, b"00010101000000"),
        (0x34, b"1%059d|0|0" % 0),
        (0x37, b"1%059d|0|0|0|0|0" % 0),
        (0x38, b"1%059d|0|0|0|0|0" % 0),
        (0x3C, b"1%059d|0|0|0" % 0),
    ],
)
def test_no_case_breaks_down_of_an_absurd_value(tried: Try, opcode: int, data: bytes) -> None:
    """Nothing can be made of it: that is undecided, and no mistake of the suite."""
    brain = type("Absurdly", (Absurd,), {"opcode": opcode, "data": data})
    only = ("2/11", "3/30", "4.5/4", "4.9/2", "5.2/12", "6.5/25", "6.5/28")
    counts = tried(brain, *only).counts
    assert not counts[Verdict.ERROR]
    assert counts[Verdict.PASS]
