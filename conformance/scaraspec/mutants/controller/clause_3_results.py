"""Faults of clause 3: the final results of two-stage commands."""

from abc import ABC, abstractmethod
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import AltersBytes, SendsLater
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

# The tag


@mutant("forgets-the-tag", "3/12", "3/14")
class ForgetsTheTag(ControllerCore):
    """Final results come without the tag."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Take it away."""
        super().emit(session, frame._replace(tagged=False))


@mutant("forgets-the-tag-of-moves", "3/12", "3/14")
class ForgetsTheTagOfMoves(ControllerCore):
    """The final result of a move comes without the tag."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Take it away."""
        super().emit(session, frame._replace(tagged=frame.tagged and frame.opcode != 0x39))


@mutant("forgets-the-tag-of-release", "3/12", "3/14")
class ForgetsTheTagOfRelease(ControllerCore):
    """The final result of releasing the joints comes without the tag."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Take it away."""
        super().emit(session, frame._replace(tagged=frame.tagged and frame.opcode != 0x3A))


@mutant("tag-behind-the-opcode", "3/12")
class TagBehindTheOpcode(AltersBytes):
    """The tag stands behind the opcode of a final result."""

    def altered(self, data: bytes) -> bytes:
        """Swap the two."""
        return data[:1] + data[2:0:-1] + data[3:] if data[1] == 0x90 else data


@mutant("another-tag", "3/12")
class AnotherTag(AltersBytes):
    """The tag of a final result is 0x91."""

    def altered(self, data: bytes) -> bytes:
        """Change it."""
        return data[:1] + b"\x91" + data[2:] if data[1] == 0x90 else data


@mutant("tags-the-outputs", "3/14")
class TagsTheOutputs(ControllerCore):
    """The digital outputs come behind the tag of final results."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Put it in front."""
        super().emit(session, frame._replace(tagged=frame.tagged or frame.opcode == 0x49))


# The order of reply and result


@mutant("locks-before-it-answers", "3/16")
class LocksBeforeItAnswers(ControllerCore):
    """The result of locking the joints is sent ahead of the first reply."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send it at once."""
        super().send_result(request, outcome)
        if request.command.name == "lock_joints":
            self._send_deferred()


@mutant("stops-before-it-answers", "3/16")
class StopsBeforeItAnswers(ControllerCore):
    """The result of an emergency stop is sent ahead of its first reply."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send it at once."""
        super().send_result(request, outcome)
        if request.command.name == "emergency_stop":
            self._send_deferred()


# Results that must not come


class _ResultOfRefusals(SendsLater):
    """What was refused gets a final result all the same."""

    opcodes: frozenset[int] = frozenset()
    late_s = 0.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember the time."""
        self._now_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Send it behind."""
        super().emit(session, frame)
        if frame.opcode in self.opcodes and not frame.tagged and frame.data[:1] == b"0":
            data = b"00|" + (frame.data[2:] or b"05")
            result = Frame(C2A, frame.opcode, data, tagged=True)
            self.send_at(self._now_s + self.late_s, session, result)


@mutant("refusals-have-results", "3/17")
class RefusalsHaveResults(_ResultOfRefusals):
    """A run that was refused ends with a failure at once."""

    opcodes = frozenset({0x30})


@mutant("far-moves-have-results", "3/17")
class FarMovesHaveResults(_ResultOfRefusals):
    """A move that was refused ends with a failure a moment later."""

    opcodes = frozenset({0x39})
    late_s = 0.3


@mutant("needless-stops-have-results", "3/17")
class NeedlessStopsHaveResults(_ResultOfRefusals):
    """An emergency stop that nothing needed has a result."""

    opcodes = frozenset({0x32})
    late_s = 0.1


@mutant("busy-refusals-have-results", "3/17", subtle=True)
class BusyRefusalsHaveResults(_ResultOfRefusals):
    """The joints, which are not locked while a program runs, tell a moment later that they are."""

    opcodes = frozenset({0x3B})
    late_s = 0.2


# One result


@mutant("simulations-have-no-result", "3/18", "4.16/3")
class SimulationsHaveNoResult(ControllerCore):
    """A simulation ends without a final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it away."""
        if request.command.name != "simulate_program":
            super().send_result(request, outcome)


class _Repeats(SendsLater, ABC):
    """Some results come twice."""

    late_s = 0.0

    @abstractmethod
    def repeats(self, frame: Frame) -> bool:
        """Whether this one does."""

    def _finish_tasks(self, now_s: float) -> None:
        self._now_s = now_s
        super()._finish_tasks(now_s)

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember the time."""
        self._now_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Send it again."""
        super().emit(session, frame)
        if frame.tagged and self.repeats(frame):
            self.send_at(self._now_s + self.late_s, session, frame)


@mutant("resets-end-twice", "3/18")
class ResetsEndTwice(_Repeats):
    """The result of a reset is sent twice."""

    def repeats(self, frame: Frame) -> bool:
        """It does."""
        return frame.opcode == 0x33


@mutant("locks-end-twice", "3/18")
class LocksEndTwice(_Repeats):
    """The result of locking the joints is sent again a quarter of a second later."""

    late_s = 0.25

    def repeats(self, frame: Frame) -> bool:
        """It does."""
        return frame.opcode == 0x3B


@mutant("tenth-run-ends-twice", "3/18", subtle=True)
class TenthRunEndsTwice(_Repeats):
    """The result of every tenth run is sent twice."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._runs = 0

    def repeats(self, frame: Frame) -> bool:
        """Every tenth does."""
        self._runs += frame.opcode == 0x30
        return frame.opcode == 0x30 and self._runs % 10 == 0


@mutant("result-for-the-newest", "3/18", "4.15/5", "4.24/6", subtle=True)
class ResultForTheNewest(ControllerCore):
    """Final results go to the client that connected last."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Send it there."""
        newest = self.sessions[max(self.sessions)] if self.sessions else request.session
        frame = request.frame
        request = Request(newest, request.command, frame, request.value, request.now_s)
        super().send_result(request, outcome)
