"""Operators that change sent frames: first replies, final results, length bytes, all bytes.

`command` is the name of a row of the command table. A change is a function of the data, or a
table of data and what is sent in its place.
"""

from collections.abc import Callable, Mapping
from typing import Any

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

Change = Callable[[bytes], bytes] | Mapping[bytes, bytes]
Core = type[ControllerCore]

TWO_STAGE = tuple(command.name for command in BY_OPCODE.values() if command.two_stage)


def first_reply(
    command: str | tuple[str, ...],
    change: Change,
    *,
    when: Callable[[ControllerCore], bool] = lambda _core: True,
) -> Core:
    """The data of first replies to one or several commands are changed, if the condition holds."""
    return _frame_data(command, change, when, tagged=False)


def final_result(command: str | tuple[str, ...], change: Change) -> Core:
    """The data of final results of one or several commands are changed."""
    return _frame_data(command, change, lambda _core: True, tagged=True)


def _frame_data(
    command: str | tuple[str, ...],
    change: Change,
    when: Callable[[ControllerCore], bool],
    *,
    tagged: bool,
) -> Core:
    opcodes = _opcodes(command)

    class FrameData(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            if frame.opcode in opcodes and frame.tagged is tagged and when(self):
                frame = frame._replace(data=_changed(change, frame.data))
            super().emit(session, frame)

    return FrameData


def outcome(
    command: str | tuple[str, ...],
    change: Callable[[ControllerCore, Request, Outcome], Outcome | None],
) -> Core:
    """The outcomes of one or several commands are changed; for None no final result is sent."""
    names = (command,) if isinstance(command, str) else command

    class ChangedOutcome(ControllerCore):
        def send_result(self, request: Request, outcome: Outcome) -> None:
            changed: Outcome | None = outcome
            if request.command.name in names:
                changed = change(self, request, outcome)
            if changed is not None:
                super().send_result(request, changed)

    return ChangedOutcome


def early_result(command: str) -> Core:
    """A final result that is ready with the first reply is sent before it."""

    class EarlyResult(ControllerCore):
        def send_result(self, request: Request, outcome: Outcome) -> None:
            super().send_result(request, outcome)
            if request.command.name == command:
                self._send_deferred()

    return EarlyResult


def length_byte(command: str, change: Callable[[int], int]) -> Core:
    """The length byte of first replies to a command is a function of the number of data bytes."""
    opcode = BY_NAME[command].opcode

    class LengthByte(ControllerCore):
        def transmit(self, session: Session, data: bytes) -> None:
            if data[1] == opcode:
                data = data[:2] + bytes((change(data[2]) % 256,)) + data[3:]
            super().transmit(session, data)

    return LengthByte


def sent_frame(when: Callable[[Frame], bool], **fields: Any) -> Core:
    """Fields of sent frames, such as the opcode, are replaced if the condition holds."""

    class SentFrame(ControllerCore):
        def emit(self, session: Session, frame: Frame) -> None:
            super().emit(session, frame._replace(**fields) if when(frame) else frame)

    return SentFrame


def frame_bytes(change: Callable[[bytes], bytes]) -> Core:
    """The bytes of every sent frame are changed."""

    class FrameBytes(ControllerCore):
        def transmit(self, session: Session, data: bytes) -> None:
            super().transmit(session, change(data))

    return FrameBytes


def _opcodes(command: str | tuple[str, ...]) -> frozenset[int]:
    names = (command,) if isinstance(command, str) else command
    return frozenset(BY_NAME[name].opcode for name in names)


def _changed(change: Change, data: bytes) -> bytes:
    return change.get(data, data) if isinstance(change, Mapping) else change(data)
