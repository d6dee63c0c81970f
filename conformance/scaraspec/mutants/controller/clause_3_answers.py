"""Mutants of clause 3: opcodes, answers and the order of execution."""

from collections.abc import Callable, Container
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import Crashes, SendsLater
from scaraspec.mutants.operators.controller.requests import ignores
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.protocol.payloads import JogDirection
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

# The opcode of a reply


def _reply_opcode(opcode: int, wrong: int) -> Core:
    """First replies to one command have another opcode."""

    class ReplyOpcode(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            if frame.opcode == opcode and not frame.tagged:
                frame = frame._replace(opcode=wrong)
            super().emit(session, frame)

    return ReplyOpcode


row(
    "angles-under-unknown-opcode",
    "3/11 3/10",
    "The joint angles have the undefined opcode 0x3E.",
    _reply_opcode(0x3C, 0x3E),
)
row(
    "version-under-time",
    "3/11",
    "The version has the opcode of the time.",
    _reply_opcode(0x08, 0x07),
)
row(
    "setter-under-getter",
    "3/11",
    "The reply to setting the gripper centre has the opcode that requests it.",
    _reply_opcode(0x35, 0x34),
)
row(
    "upload-under-download",
    "3/11",
    "The reply to the name of an upload has the opcode of a download.",
    _reply_opcode(0x50, 0x54),
)
row(
    "deletion-under-default",
    "3/11",
    "The reply to a deletion has the next opcode.",
    _reply_opcode(0x0C, 0x0D),
)


@mutant("opcode-of-the-last-request", "3/11", "3/31", subtle=True)
class RepliesWithLastOpcode(ControllerCore):
    """After two hundred requests, analog values have the opcode of the previous request."""

    _count, _last = 0, 0x09

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._count += 1
        super().handle(session, frame, now_s)
        self._last = frame.opcode

    def emit(self, session: Session, frame: Frame) -> None:
        late = self._count > 200 and frame.opcode == 0x44
        super().emit(session, frame._replace(opcode=self._last) if late else frame)


# Undefined opcodes


def _on_undefined(
    opcodes: Container[int], act: Callable[[Crashes, Session, Frame, float], object]
) -> Core:
    """A request of a client that is logged in has an effect, if its opcode is undefined."""

    class OnUndefined(Crashes):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            if not session.logged_in or frame.opcode in BY_OPCODE:
                super().handle(session, frame, now_s)
            elif frame.opcode in opcodes:
                act(self, session, frame, now_s)

    return OnUndefined


def _jog(core: ControllerCore, _session: Session, _frame: Frame, now_s: float) -> None:
    if core.robot.task is None:
        core.plant.start(motion.jog(core.plant.joints(now_s), JogDirection.PLUS_Y), now_s)


def _set_output(core: ControllerCore, _session: Session, frame: Frame, _now_s: float) -> None:
    if frame.data == b"1|1":
        core.plant.digital_outputs[1] = True


def _cancel(_core: ControllerCore, session: Session, _frame: Frame, _now_s: float) -> None:
    session.transfer = None


def _stop(core: ControllerCore, _session: Session, _frame: Frame, now_s: float) -> None:
    task = core.robot.stop(now_s)
    if task is not None:
        core.send_result(task.request, task.outcome_if_stopped)


def _clear_outputs(core: ControllerCore, _session: Session, _frame: Frame, _now_s: float) -> None:
    for port in range(1, 17):
        core.plant.digital_outputs[port] = False


def _log_out(_core: ControllerCore, session: Session, _frame: Frame, _now_s: float) -> None:
    session.logged_in = False


row(
    "answers-with-error-opcode",
    "3/21",
    "An undefined opcode is answered with the opcode 0xFF.",
    _on_undefined(range(256), lambda core, session, *_: core.emit(session, Frame(C2A, 0xFF, b"0"))),
)
row(
    "ignores-high-bit",
    "3/21",
    "The highest bit of an opcode is ignored, so that 0x89 requests the status.",
    _on_undefined(
        (0x87, 0x88, 0x89, 0x8B),
        lambda core, session, frame, now_s: core.handle(
            session, frame._replace(opcode=frame.opcode & 0x7F), now_s
        ),
    ),
)
row(
    "jogs-on-cut-opcodes",
    "3/21",
    "0x3E to 0x41, which are missing in the document, jog the arm.",
    _on_undefined(range(0x3E, 0x42), _jog),
)
row(
    "sets-outputs-on-unknown",
    "3/21",
    "0x45 sets the digital output that its data name.",
    _on_undefined((0x45,), _set_output),
)
row(
    "defaults-on-unknown",
    "3/21",
    "0x02 sets the gripper centre to the factory setting.",
    _on_undefined((0x02,), lambda core, *_: core.save(gripper_center=(1.0, 1.0, 1.0))),
)
row(
    "clears-on-unknown",
    "3/21",
    "0x10 clears the default program.",
    _on_undefined((0x10,), lambda core, *_: core.save(default_program=b"")),
    subtle=True,
)
row(
    "cancels-on-unknown",
    "3/21",
    "0x51 ends the upload of its connection.",
    _on_undefined((0x51,), _cancel),
    subtle=True,
)
row(
    "stops-on-unknown",
    "3/21",
    "0xFF stops the command that executes.",
    _on_undefined((0xFF,), _stop),
    subtle=True,
)
row(
    "switches-off-on-unknown",
    "3/21",
    "0x48 switches every digital output off.",
    _on_undefined((0x48,), _clear_outputs),
    subtle=True,
)
row(
    "dies-of-high-opcodes",
    "3/21",
    "The controller crashes on an opcode above 0xF0 with 255 bytes of data.",
    _on_undefined(
        range(0xF1, 0x100),
        lambda core, _session, frame, now_s: core.crash(now_s) if len(frame.data) == 255 else None,
    ),
    subtle=True,
)
row(
    "deaf-after-unknown",
    "3/21",
    "After the undefined opcode 0x14, no request on its connection is answered.",
    _on_undefined((0x14,), _log_out),
)

# Requests without waiting


def _together(change: Callable[[list[StreamItem]], list[StreamItem]]) -> Core:
    """The frames that arrive together are changed."""

    class Together(ControllerCore):
        def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
            super()._process_items(session, change(found), now_s)

    return Together


def _is(item: StreamItem, opcode: int) -> bool:
    return isinstance(item, Frame) and item.opcode == opcode


row(
    "loses-third-of-burst",
    "3/24 2/6 3/31",
    "The third of several requests that arrive together is not answered.",
    _together(lambda found: found[:2] + found[3:]),
    subtle=True,
)
row(
    "answers-same-once",
    "3/24 2/6",
    "Only one of several equal requests that arrive together is answered.",
    _together(lambda found: list(dict.fromkeys(found))),
    subtle=True,
)
row(
    "last-setting-first",
    "3/30",
    "Gripper centres that arrive together are set from the last to the first.",
    _together(lambda found: found[::-1] if all(_is(item, 0x35) for item in found) else found),
)
row(
    "stops-first",
    "3/30",
    "An emergency stop is executed before other requests that arrive together with it.",
    _together(lambda found: sorted(found, key=lambda item: not _is(item, 0x32))),
)
row(
    "queries-last",
    "3/30",
    "A request of the gripper centre is answered after others that arrive together with it.",
    _together(lambda found: sorted(found, key=lambda item: _is(item, 0x34))),
)


@mutant("clock-of-the-first", "3/30", subtle=True)
class SetsFirstTime(ControllerCore):
    """Only the first of several times that arrive together is set, but all are answered 1."""

    _set_s = -1.0

    def set_time(self, request: Request) -> bool:
        if request.now_s == self._set_s:
            return True
        self._set_s = request.now_s
        return super().set_time(request)


row(
    "chunks-before-names",
    "3/30",
    "Chunks are processed before the file name that arrives together with them.",
    _together(lambda found: sorted(found, key=lambda item: _is(item, 0x50))),
)

# No answer


def _loses(when: Callable[[int], bool]) -> Core:
    """A request is ignored, if its number on its connection fulfils a condition."""

    class Loses(ControllerCore):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            self._counts: dict[Session, int] = {}

        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            self._counts[session] = self._counts.get(session, 0) + 1
            if not when(self._counts[session]):
                super().handle(session, frame, now_s)

    return Loses


row(
    "never-tells-temperatures",
    "3/31",
    "A request of the motor temperatures is not answered.",
    ignores("get_motor_temperatures", lambda _core, _request: True),
)
row(
    "thousand-requests",
    "3/31",
    "After a thousand requests on a connection no further one is answered.",
    _loses(lambda number: number > 1000),
    subtle=True,
)
row(
    "loses-one-in-seven-hundred",
    "3/31",
    "Every seven-hundredth request of a connection is not answered.",
    _loses(lambda number: number % 700 == 0),
    subtle=True,
)


@mutant("loses-request-behind-refusals", "3/31", subtle=True)
class IgnoresAfterRefusals(ControllerCore):
    """After thirty refused downloads on a connection no request is answered."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: dict[Session, int] = {}

    def download_name(self, request: Request) -> bool:
        found = super().download_name(request)
        if not found:
            session = request.session
            self._refused[session] = self._refused.get(session, 0) + 1
        return found

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if self._refused.get(session, 0) < 30:
            super().handle(session, frame, now_s)


@mutant("twenty-file-handles", "3/31", "5.2/2", subtle=True)
class RefusesAfterTwentyUploads(ControllerCore):
    """Each upload keeps a file open; after twenty uploads every further one is refused."""

    _opened = 0

    def upload_name(self, request: Request) -> bool:
        self._opened += 1
        return self._opened <= 20 and super().upload_name(request)


@mutant("answers-after-six-seconds", "3/31")
class AnswersAfterSixSeconds(SendsLater):
    """An analog value is sent six seconds after its request."""

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x44:
            self.send_later(6, session, frame)
        else:
            super().emit(session, frame)


@mutant("each-hundredth-reply-is-late", "3/31", subtle=True)
class SendsEachHundredthLate(SendsLater):
    """Each hundredth first reply of a connection is sent after six seconds, and out of order."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._sent: dict[Session, int] = {}

    def emit(self, session: Session, frame: Frame) -> None:
        self._sent[session] = self._sent.get(session, 0) + (not frame.tagged)
        if self._sent[session] % 100 == 0 and not frame.tagged:
            self.send_later(6, session, frame)
        else:
            super().emit(session, frame)


@mutant("takes-equals-for-repetition", "3/31", subtle=True)
class IgnoresRepetitions(ControllerCore):
    """A request of the joint angles that directly follows an equal one is not answered."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._last: dict[Session, Frame] = {}

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        repeated = self._last.get(session) == frame and frame.opcode == 0x3C
        self._last[session] = frame
        if not repeated:
            super().handle(session, frame, now_s)
