"""Mutants of clause 3: the final results of two-stage commands."""

from collections.abc import Callable
from dataclasses import replace

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import SendsLater
from scaraspec.mutants.operators.controller.replies import early_result, frame_bytes, outcome
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


def _tag(is_tagged: Callable[[Frame], bool]) -> Core:
    """Each frame has the tag if `is_tagged` returns True for it."""

    class Tag(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            super().emit(session, frame._replace(tagged=is_tagged(frame)))

    return Tag


def _result_of_refusal(opcode: int, delay_s: float) -> Core:
    """After a refusal, a final result that reports a failure is sent after `delay_s`."""

    class ResultOfRefusal(SendsLater):
        def emit(self, session: Session, frame: Frame) -> None:
            super().emit(session, frame)
            if frame.opcode == opcode and not frame.tagged and frame.data[:1] == b"0":
                data = b"00|" + (frame.data[2:] or b"05")
                self.send_later(delay_s, session, Frame(C2A, opcode, data, tagged=True))

    return ResultOfRefusal


def _repeats(opcode: int, delay_s: float = 0.0, every: int = 1) -> Core:
    """Every final result of one command is sent twice, or only every Nth one."""

    class Repeats(SendsLater):
        _results = 0

        def _finish_tasks(self, now_s: float) -> None:
            self.now_s = now_s
            super()._finish_tasks(now_s)

        def emit(self, session: Session, frame: Frame) -> None:
            super().emit(session, frame)
            if frame.tagged and frame.opcode == opcode:
                self._results += 1
                if self._results % every == 0:
                    self.send_later(delay_s, session, frame)

    return Repeats


# The tag

row(
    "forgets-the-tag",
    "3/12 3/14",
    "Final results have no tag.",
    _tag(lambda _frame: False),
)
row(
    "forgets-the-tag-of-moves",
    "3/12 3/14",
    "The final result of a move has no tag.",
    _tag(lambda frame: frame.tagged and frame.opcode != 0x39),
)
row(
    "forgets-the-tag-of-release",
    "3/12 3/14",
    "The final result of releasing the joints has no tag.",
    _tag(lambda frame: frame.tagged and frame.opcode != 0x3A),
)
row(
    "tag-behind-the-opcode",
    "3/12",
    "The tag follows the opcode of a final result.",
    frame_bytes(lambda data: data[:1] + data[2:0:-1] + data[3:] if data[1] == 0x90 else data),
)
row(
    "another-tag",
    "3/12",
    "The tag of a final result is 0x91.",
    frame_bytes(lambda data: data[:1] + b"\x91" + data[2:] if data[1] == 0x90 else data),
)
row(
    "tags-the-outputs",
    "3/14",
    "The reply with the digital outputs has the tag of final results.",
    _tag(lambda frame: frame.tagged or frame.opcode == 0x49),
)

# The order of reply and result

row(
    "locks-before-it-answers",
    "3/16",
    "The result of locking the joints is sent before the first reply.",
    early_result("lock_joints"),
)
row(
    "stops-before-it-answers",
    "3/16",
    "The result of an emergency stop is sent before its first reply.",
    early_result("emergency_stop"),
)

# Results that must not be sent

row(
    "refusals-have-results",
    "3/17",
    "A refused run has a failed final result at once.",
    _result_of_refusal(0x30, 0.0),
)
row(
    "far-moves-have-results",
    "3/17",
    "A refused move has a failed final result after 0.3 s.",
    _result_of_refusal(0x39, 0.3),
)
row(
    "needless-stops-have-results",
    "3/17",
    "An emergency stop of an idle robot has a failed final result after 0.1 s.",
    _result_of_refusal(0x32, 0.1),
)
row(
    "busy-refusals-have-results",
    "3/17",
    "A lock that is refused has a failed final result after 0.2 s.",
    _result_of_refusal(0x3B, 0.2),
    subtle=True,
)

# One result

row(
    "simulations-have-no-result",
    "3/18 4.16/3",
    "A simulation ends without a final result.",
    outcome("simulate_program", lambda _core, _request, _ended: None),
)
row(
    "resets-end-twice",
    "3/18",
    "The result of a reset is sent twice.",
    _repeats(0x33),
)
row(
    "locks-end-twice",
    "3/18",
    "The result of locking the joints is sent again 0.25 s later.",
    _repeats(0x3B, delay_s=0.25),
)
row(
    "tenth-run-ends-twice",
    "3/18",
    "The result of every tenth run is sent twice.",
    _repeats(0x30, every=10),
    subtle=True,
)


@mutant("result-for-the-newest", "3/18", "4.15/5", "4.24/6", subtle=True)
class SendsResultsToNewest(ControllerCore):
    """Final results go to the client that connected last."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if self.sessions:
            request = replace(request, session=self.sessions[max(self.sessions)])
        super().send_result(request, outcome)
