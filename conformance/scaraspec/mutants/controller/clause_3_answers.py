"""Faults of clause 3: opcodes, what is answered, and in which order things happen."""

from abc import ABC, abstractmethod
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import Mortal, SendsLater
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.protocol.payloads import JogDirection
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

# The opcode of a reply


class _OtherOpcode(ControllerCore):
    """Replies to one command bear another opcode."""

    opcode = 0
    instead = 0

    def emit(self, session: Session, frame: Frame) -> None:
        """Put it in."""
        if frame.opcode == self.opcode and not frame.tagged:
            frame = frame._replace(opcode=self.instead)
        super().emit(session, frame)


@mutant("angles-under-unknown-opcode", "3/11", "3/10")
class AnglesUnderUnknownOpcode(_OtherOpcode):
    """The joint angles come under the undefined opcode 0x3E."""

    opcode, instead = 0x3C, 0x3E


@mutant("version-under-time", "3/11")
class VersionUnderTime(_OtherOpcode):
    """The version comes under the opcode of the time."""

    opcode, instead = 0x08, 0x07


@mutant("setter-under-getter", "3/11")
class SetterUnderGetter(_OtherOpcode):
    """The reply to the gripper centre that was set comes under the opcode that asks for it."""

    opcode, instead = 0x35, 0x34


@mutant("upload-under-download", "3/11")
class UploadUnderDownload(_OtherOpcode):
    """The reply to the name of an upload comes under the opcode of a download."""

    opcode, instead = 0x50, 0x54


@mutant("deletion-under-default", "3/11")
class DeletionUnderDefault(_OtherOpcode):
    """The reply to a deletion comes under the opcode next to it."""

    opcode, instead = 0x0C, 0x0D


@mutant("opcode-of-the-last-request", "3/11", "3/31", subtle=True)
class OpcodeOfTheLastRequest(ControllerCore):
    """After two hundred requests, replies bear the opcode of the request before."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._count, self._last = 0, 0x09

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember what is asked."""
        self._count += 1
        super().handle(session, frame, now_s)
        self._last = frame.opcode

    def emit(self, session: Session, frame: Frame) -> None:
        """Put the last one in."""
        late = self._count > 200 and frame.opcode == 0x44
        super().emit(session, frame._replace(opcode=self._last) if late else frame)


# Undefined opcodes


class _Undefined(Mortal, ABC):
    """Does something on undefined opcodes."""

    @abstractmethod
    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:
        """What it does."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Do it for a client that has logged in."""
        if session.logged_in and frame.opcode not in BY_OPCODE:
            self.undefined(session, frame, now_s)
        else:
            super().handle(session, frame, now_s)


@mutant("answers-with-error-opcode", "3/21")
class AnswersWithErrorOpcode(_Undefined):
    """An undefined opcode is answered with the opcode 0xFF."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Answer."""
        self.emit(session, Frame(C2A, 0xFF, b"0"))


@mutant("ignores-high-bit", "3/21")
class IgnoresHighBit(_Undefined):
    """The highest bit of an opcode is overlooked, so that 0x89 asks for the status."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take the bit away."""
        known = frame._replace(opcode=frame.opcode & 0x7F)
        if known.opcode in (0x07, 0x08, 0x09, 0x0B):
            super().handle(session, known, now_s)


@mutant("jogs-on-cut-opcodes", "3/21")
class JogsOnCutOpcodes(_Undefined):
    """0x3E to 0x41, which were cut from the document, still jog the arm."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Move along one axis for a moment."""
        if frame.opcode in range(0x3E, 0x42) and self.robot.task is None:
            way = motion.jog(self.plant.joints(now_s), JogDirection.PLUS_Y)
            self.plant.start(way, now_s)


@mutant("sets-outputs-on-unknown", "3/21")
class SetsOutputsOnUnknown(_Undefined):
    """0x45 sets the digital output that its data name."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Set it."""
        if frame.opcode == 0x45 and frame.data == b"1|1":
            self.plant.digital_outputs[1] = True


@mutant("defaults-on-unknown", "3/21")
class DefaultsOnUnknown(_Undefined):
    """0x02 puts the gripper centre back to what it was when the robot was delivered."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Put it back."""
        if frame.opcode == 0x02:
            self.save(gripper_center=(1.0, 1.0, 1.0))


@mutant("clears-on-unknown", "3/21", subtle=True)
class ClearsOnUnknown(_Undefined):
    """0x10 leaves no default program."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Clear it."""
        if frame.opcode == 0x10:
            self.save(default_program=b"")


@mutant("cancels-on-unknown", "3/21", subtle=True)
class CancelsOnUnknown(_Undefined):
    """0x51 ends the upload that is open on its connection."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """End it."""
        if frame.opcode == 0x51:
            session.transfer = None


@mutant("stops-on-unknown", "3/21", subtle=True)
class StopsOnUnknown(_Undefined):
    """0xFF ends what executes."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """End it."""
        task = self.robot.task
        if frame.opcode == 0xFF and task is not None:
            self.robot.stop(now_s)
            self.send_result(task.request, task.outcome_if_stopped)


@mutant("switches-off-on-unknown", "3/21", subtle=True)
class SwitchesOffOnUnknown(_Undefined):
    """0x48 switches every digital output off."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Switch them off."""
        if frame.opcode == 0x48:
            for port in range(1, 17):
                self.plant.digital_outputs[port] = False


@mutant("dies-of-high-opcodes", "3/21", subtle=True)
class DiesOfHighOpcodes(_Undefined):
    """An opcode beyond the table of commands, with 255 bytes of data, ends the program."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if frame.opcode > 0xF0 and len(frame.data) == 255:
            self.die(now_s)


@mutant("deaf-after-unknown", "3/21")
class DeafAfterUnknown(_Undefined):
    """After the undefined opcode 0x13 plus one, nothing on its connection is answered any more."""

    def undefined(self, session: Session, frame: Frame, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Forget the login, so that nothing is served."""
        if frame.opcode == 0x14:
            session.logged_in = False


# Requests without waiting


@mutant("loses-third-of-burst", "3/24", "2/6", "3/31", subtle=True)
class LosesThirdOfBurst(ControllerCore):
    """Of requests that come together the third is never answered."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        super()._process_items(session, found[:2] + found[3:], now_s)


@mutant("answers-same-once", "3/24", "2/6", subtle=True)
class AnswersSameOnce(ControllerCore):
    """Of equal requests that come together only one is answered."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        super()._process_items(session, list(dict.fromkeys(found)), now_s)


def _is(item: StreamItem, *opcodes: int) -> bool:
    return isinstance(item, Frame) and item.opcode in opcodes


class _Sorts(ControllerCore, ABC):
    """Serves what comes together in another order."""

    @abstractmethod
    def rank(self, item: StreamItem) -> int:
        """The lowest come first."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        super()._process_items(session, sorted(found, key=self.rank), now_s)


@mutant("last-setting-first", "3/30")
class LastSettingFirst(ControllerCore):
    """Settings that come together take effect from the last to the first."""

    def _process_items(self, session: Session, found: list[StreamItem], now_s: float) -> None:
        turned = all(_is(item, 0x35) for item in found)
        super()._process_items(session, found[::-1] if turned else found, now_s)


@mutant("stops-first", "3/30")
class StopsFirst(_Sorts):
    """Of requests that come together the emergency stop is served first."""

    def rank(self, item: StreamItem) -> int:
        """The stop before all others."""
        return 0 if _is(item, 0x32) else 1


@mutant("queries-last", "3/30")
class QueriesLast(_Sorts):
    """Of requests that come together those that read are served last."""

    def rank(self, item: StreamItem) -> int:
        """Settings before questions."""
        return 1 if _is(item, 0x34) else 0


@mutant("clock-of-the-first", "3/30", subtle=True)
class ClockOfTheFirst(ControllerCore):
    """Of times that come together only the first is set, though all are answered with yes."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._set_s = -1.0

    def set_time(self, request: Request) -> bool:
        """Set one in an instant."""
        if request.now_s == self._set_s:
            return True
        self._set_s = request.now_s
        return super().set_time(request)


@mutant("chunks-before-names", "3/30")
class ChunksBeforeNames(_Sorts):
    """Of requests that come together the chunks are taken before the name of their file."""

    def rank(self, item: StreamItem) -> int:
        """Chunks before names."""
        return 1 if _is(item, 0x50) else 0


# No answer


class _FallsSilent(ControllerCore, ABC):
    """Some requests are never answered."""

    @abstractmethod
    def silent(self, session: Session, frame: Frame) -> bool:
        """Whether this is one of them."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve it, or not."""
        if not self.silent(session, frame):
            super().handle(session, frame, now_s)


@mutant("never-tells-temperatures", "3/31")
class NeverTellsTemperatures(_FallsSilent):
    """The motor temperatures are never told."""

    def silent(self, session: Session, frame: Frame) -> bool:  # noqa: ARG002 - one signature
        """Keep them."""
        return frame.opcode == 0x0F


class _Counts(_FallsSilent, ABC):
    """Counts the requests of each connection."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._counts: dict[Session, int] = {}

    def silent(self, session: Session, frame: Frame) -> bool:  # noqa: ARG002 - one signature
        """Count them."""
        self._counts[session] = self._counts.get(session, 0) + 1
        return self.wrong(self._counts[session])

    @abstractmethod
    def wrong(self, number: int) -> bool:
        """Whether this one is lost."""


@mutant("thousand-requests", "3/31", subtle=True)
class ThousandRequests(_Counts):
    """After a thousand requests a connection is not served any more."""

    def wrong(self, number: int) -> bool:
        """Serve no more."""
        return number > 1000


@mutant("loses-one-in-seven-hundred", "3/31", subtle=True)
class LosesOneInSevenHundred(_Counts):
    """Every seven-hundredth request of a connection is lost."""

    def wrong(self, number: int) -> bool:
        """Lose it."""
        return number % 700 == 0


@mutant("loses-request-behind-refusals", "3/31", subtle=True)
class LosesRequestBehindRefusals(_FallsSilent):
    """Behind thirty refused downloads on a connection nothing is answered."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: dict[Session, int] = {}

    def download_name(self, request: Request) -> bool:
        """Count refusals."""
        found = super().download_name(request)
        if not found:
            session = request.session
            self._refused[session] = self._refused.get(session, 0) + 1
        return found

    def silent(self, session: Session, frame: Frame) -> bool:  # noqa: ARG002 - one signature
        """Keep silent."""
        return self._refused.get(session, 0) >= 30


@mutant("twenty-file-handles", "3/31", "5.2/2", subtle=True)
class TwentyFileHandles(ControllerCore):
    """Each upload keeps a file open; after twenty no further one is taken."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._opened = 0

    def upload_name(self, request: Request) -> bool:
        """Open one more."""
        self._opened += 1
        return self._opened <= 20 and super().upload_name(request)


@mutant("answers-after-six-seconds", "3/31")
class AnswersAfterSixSeconds(SendsLater):
    """The analog value comes after six seconds."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember the time."""
        self._now_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Send it later."""
        if frame.opcode == 0x44:
            self.send_at(self._now_s + 6, session, frame)
        else:
            super().emit(session, frame)


@mutant("takes-equals-for-repetition", "3/31", subtle=True)
class TakesEqualsForRepetition(_FallsSilent):
    """A request that equals the one before on its connection is taken for its repetition."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._last: dict[Session, Frame] = {}

    def silent(self, session: Session, frame: Frame) -> bool:
        """Compare it with the last one."""
        repeated = self._last.get(session) == frame and frame.opcode == 0x3C
        self._last[session] = frame
        return repeated
