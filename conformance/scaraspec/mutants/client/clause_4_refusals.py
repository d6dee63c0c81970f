"""Faults of clause 4: refusals that are not understood, and codes that are not told."""

from abc import ABC, abstractmethod
from dataclasses import replace

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import ClientError, Failed, Refused
from scaraspec.client.pending_operation import PendingOperation, TwoStage
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersReplies, AltersResults, OtherTwoStage
from scaraspec.protocol import errors
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame

_STOP = 0x32  # refused without a code (L366)


class _AltersRefusals(ClientCore, ABC):
    """What was refused is not always taken for that."""

    @abstractmethod
    def overlooked(self, frame: Frame) -> bool:
        """Whether this refusal is taken for a yes."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        command = BY_OPCODE.get(frame.opcode)
        two_stage = command is not None and command.two_stage and not frame.tagged
        if two_stage and frame.data[:1] == b"0" and self.overlooked(frame):
            frame = frame._replace(data=b"1")
        return super()._dispatch(frame, now_s)


@mutant("every-reply-is-yes", "4/13")
class EveryReplyIsYes(_AltersRefusals):
    """A first reply is taken for a yes, whatever it says."""

    def overlooked(self, frame: Frame) -> bool:
        """Do not look."""
        return bool(frame.data)


@mutant("bare-refusal-is-yes", "4/13", subtle=True)
class BareRefusalIsYes(_AltersRefusals):
    """A refusal is known by its bar: a 0 alone is taken for a yes."""

    def overlooked(self, frame: Frame) -> bool:
        """Look for it."""
        return frame.data == b"0" and frame.opcode != _STOP


@mutant("unknown-refusal-is-yes", "4/13", subtle=True)
class UnknownRefusalIsYes(_AltersRefusals):
    """A refusal whose code is in no table is taken for a yes."""

    def overlooked(self, frame: Frame) -> bool:
        """Look it up."""
        return b"|" in frame.data and errors.lookup(frame.data[2:].decode("latin-1")) is None


@mutant("missing-file-is-waited-for", "4/13", subtle=True)
class MissingFileIsWaitedFor(_AltersRefusals):
    """A refusal with the code 20, for a missing program, is taken for a yes."""

    def overlooked(self, frame: Frame) -> bool:
        """Do not know it."""
        return frame.data == b"0|20"


@mutant("busy-behind-refusals", "4/13", subtle=True)
class BusyBehindRefusals(ClientCore):
    """After a refusal the client goes on counting the command as under way: no other is sent."""

    _refused = ""

    def is_free(self, slot: str) -> bool:
        """Hold the next one back."""
        return slot != self._refused and super().is_free(slot)

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        if isinstance(operation, TwoStage) and isinstance(operation.error, Refused):
            self._refused = operation.slot
        return super()._after_step(operation, now_s)


class _RefusedIsFailed(TwoStage):
    """A refusal is a failure."""

    def fail(self, error: ClientError) -> None:
        """Tell it as one."""
        super().fail(Failed(self.command, error.code) if isinstance(error, Refused) else error)


@mutant("refusal-is-told-as-failure", "4/13")
class RefusalIsToldAsFailure(OtherTwoStage):
    """What was refused is told as begun and failed."""

    shape = _RefusedIsFailed


# Codes


class _AltersCodes(TwoStage, ABC):
    """The code is told otherwise."""

    @abstractmethod
    def text(self, code: str) -> str:
        """What is told in its place."""

    def fail(self, error: ClientError) -> None:
        """Tell that."""
        if isinstance(error, Refused | Failed) and error.code is not None:
            error.code = replace(error.code, text=self.text(error.code.text))
        super().fail(error)


class _AsNumbers(_AltersCodes):
    def text(self, code: str) -> str:
        """Lose the zero."""
        return code.lstrip("0")


class _AsDecimals(_AltersCodes):
    def text(self, code: str) -> str:
        """Take it for hexadecimal."""
        return f"{int(code, 16)}" if code.isalnum() else code


class _OfMotorsOnly(_AltersCodes):
    def text(self, code: str) -> str:
        """Know no others."""
        return code if code[:1] == "1" else "1F"


@mutant("codes-lose-their-zero", "4/12")
class CodesLoseTheirZero(OtherTwoStage):
    """Codes are told as numbers: of 05 the zero is lost."""

    shape = _AsNumbers


@mutant("codes-are-told-in-decimals", "4/12")
class CodesAreToldInDecimals(OtherTwoStage):
    """Codes are told in decimals: 12 becomes 18."""

    shape = _AsDecimals


@mutant("every-other-code-blames-motors", "4/12")
class EveryOtherCodeBlamesMotors(OtherTwoStage):
    """Whatever is no motor's fault is told as one of all motors."""

    shape = _OfMotorsOnly


@mutant("code-before-the-last", "4/12", subtle=True)
class CodeBeforeTheLast(ClientCore):
    """With every refusal or failure the code of the one before is told."""

    _before: errors.Code | None = None

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        error = operation.error
        if isinstance(error, Refused | Failed) and error.code is not None:
            code, error.code = error.code, self._before or error.code
            self._before = code
        return super()._after_step(operation, now_s)


@mutant("code-zero-is-success", "4/12", subtle=True)
class CodeZeroIsSuccess(AltersResults):
    """A failure with the code 00 is taken for a success: no error has occurred."""

    def altered(self, data: bytes) -> bytes:
        """Look at the code alone."""
        return b"11" if data == b"00|00" else data


@mutant("unknown-failure-is-success", "4/12", subtle=True)
class UnknownFailureIsSuccess(AltersResults):
    """A failure whose code is in no table is taken for a success."""

    def altered(self, data: bytes) -> bytes:
        """Look it up."""
        known = errors.lookup(data[3:].decode("latin-1"))
        return b"11" if data[:2] == b"00" and known is None else data


@mutant("reserved-failure-is-success", "4/12", subtle=True)
class ReservedFailureIsSuccess(AltersResults):
    """A failure with a reserved code is taken for a success."""

    def altered(self, data: bytes) -> bytes:
        """Look it up."""
        code = errors.lookup(data[3:].decode("latin-1"))
        return b"11" if data[:2] == b"00" and code in errors.RESERVED else data


class _MixesUpJoints(_AltersCodes):
    def text(self, code: str) -> str:
        """Swap two bits."""
        return told_of_swapped(code)


def told_of_swapped(code: str) -> str:
    """A code with the wrist's bit and the gripper's in each other's place."""
    known = errors.lookup(code)
    if known is None or not known.joints:
        return code
    swapped = {errors.Joint.WRIST: errors.Joint.ROTATION, errors.Joint.ROTATION: errors.Joint.WRIST}
    return errors.code_for_joints(swapped.get(joint, joint) for joint in known.joints).text


@mutant("wrist-is-taken-for-the-gripper", "8/4", "4/12")
class WristIsTakenForTheGripper(OtherTwoStage):
    """Of an order's code the wrist's bit and the gripper's are mixed up."""

    shape = _MixesUpJoints


@mutant("status-mixes-up-joints", "8/4")
class StatusMixesUpJoints(AltersReplies):
    """Of the status the wrist's bit and the gripper's are mixed up."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Swap them."""
        return told_of_swapped(data.decode("latin-1")).encode("latin-1")


@mutant("one-joint-of-several", "8/4", subtle=True)
class OneJointOfSeveral(AltersReplies):
    """Of several faulty joints the status tells the first one only."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Forget the others."""
        code = errors.lookup(data.decode("latin-1"))
        if code is None or not code.joints:
            return data
        return errors.code_for_joints(code.joints[:1]).text.encode()


@mutant("small-letters-are-idle", "8/6")
class SmallLettersAreIdle(AltersReplies):
    """A status in small letters is in no table, and taken for idle."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Look it up as it is."""
        return b"00" if data != data.upper() else data


@mutant("small-letters-succeed", "8/6", subtle=True)
class SmallLettersSucceed(AltersResults):
    """A failure whose code is in small letters is in no table, and taken for a success."""

    def altered(self, data: bytes) -> bytes:
        """Look it up as it is."""
        return b"11" if data != data.upper() else data


@mutant("small-letters-are-yes", "8/6", subtle=True)
class SmallLettersAreYes(_AltersRefusals):
    """A refusal whose code is in small letters is in no table, and taken for a yes."""

    def overlooked(self, frame: Frame) -> bool:
        """Look it up as it is."""
        return frame.data != frame.data.upper()


@mutant("small-letters-are-digits", "8/6", subtle=True)
class SmallLettersAreDigits(AltersReplies):
    """A status in small letters is read digit by digit from a table of capitals: 1a becomes 10."""

    name = "get_status"

    def altered(self, data: bytes) -> bytes:
        """Miss the letter."""
        return data[:1] + b"0" if data != data.upper() else data
