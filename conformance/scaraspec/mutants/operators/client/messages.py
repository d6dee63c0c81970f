"""Operators that change one message of the reference client, or the value that it returns.

`command` is the name of a row of the command table. A change is a function of the data, or a
table of data and what is sent or read in its place.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import Refused
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

Change = Callable[[bytes], bytes] | Mapping[bytes, bytes]


def request_data(command: str, change: Change) -> type[ClientCore]:
    """The data of requests of one command are changed before they are sent."""

    class RequestData(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(_changed(frame, command, change) for frame in frames)

    return RequestData


def request_fields(command: str, change: Callable[[list[bytes]], list[bytes]]) -> type[ClientCore]:
    """The fields of requests of one command are changed before they are sent."""
    return request_data(command, lambda data: b"|".join(change(data.split(b"|"))))


def request_frame(command: str, change: Callable[[Frame], Frame]) -> type[ClientCore]:
    """Requests of one command are replaced by other frames."""

    class RequestFrame(ClientCore):
        def _send(self, frames: Iterable[Frame]) -> None:
            opcode = BY_NAME[command].opcode
            super()._send(change(frame) if frame.opcode == opcode else frame for frame in frames)

    return RequestFrame


def numbered_request(command: str, change: Callable[[bytes, int], bytes]) -> type[ClientCore]:
    """The data of requests of one command are changed, depending on their number from 1."""

    class NumberedRequest(ClientCore):
        count = 0

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._numbered, frames))

        def _numbered(self, frame: Frame) -> Frame:
            if frame.opcode != BY_NAME[command].opcode:
                return frame
            self.count += 1
            return frame._replace(data=change(frame.data, self.count))

    return NumberedRequest


def request_after(
    command: str, other: str, change: Callable[[bytes, bytes], bytes]
) -> type[ClientCore]:
    """The data of requests are changed, depending on the data of the last `other` request."""

    class RequestAfter(ClientCore):
        last = b""

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._replaced, frames))

        def _replaced(self, frame: Frame) -> Frame:
            if frame.opcode == BY_NAME[other].opcode:
                self.last = frame.data
            if frame.opcode == BY_NAME[command].opcode:
                return frame._replace(data=change(frame.data, self.last))
            return frame

    return RequestAfter


def request_over_last(command: str) -> type[ClientCore]:
    """The data of a request are written over those of the last one, which may be longer."""

    class RequestOverLast(ClientCore):
        buffer = b""

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._written, frames))

        def _written(self, frame: Frame) -> Frame:
            if frame.opcode != BY_NAME[command].opcode:
                return frame
            self.buffer = frame.data + self.buffer[len(frame.data) :]
            return frame._replace(data=self.buffer)

    return RequestOverLast


def unchecked(command: str, condition: Callable[[float], bool], field: int = 0) -> type[ClientCore]:
    """A number that satisfies the condition is sent although the document does not allow it."""

    class Unchecked(ClientCore):
        number: float | None = None

        def command(self, name: str, value: Any = None) -> PendingOperation:
            self.number = None
            if name == command:
                fields = list(value) if isinstance(value, tuple) else [value]
                if condition(fields[field]):
                    self.number, fields[field] = fields[field], 1
                    value = type(value)(*fields)
            return super().command(name, value)

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._written, frames))

        def _written(self, frame: Frame) -> Frame:
            if self.number is None or frame.opcode != BY_NAME[command].opcode:
                return frame
            fields = frame.data.split(b"|")
            fields[field] = f"{self.number}".encode()
            return frame._replace(data=b"|".join(fields))

    return Unchecked


def sent_raw(
    commands: Collection[str], raw: Callable[[Any], bytes], valid: Callable[[Any], Any]
) -> type[ClientCore]:
    """A value that the document does not allow is sent as `raw` returns it; b"" sends no value.

    `valid` returns a value that the encoder accepts in its place.
    """
    opcodes = {BY_NAME[name].opcode for name in commands}

    class SentRaw(ClientCore):
        raw = b""

        def command(self, name: str, value: Any = None) -> PendingOperation:
            if name in commands and (data := raw(value)):
                self.raw, value = data, valid(value)
            return super().command(name, value)

        def _send(self, frames: Iterable[Frame]) -> None:
            super()._send(map(self._replaced, frames))

        def _replaced(self, frame: Frame) -> Frame:
            if not self.raw or frame.opcode not in opcodes:
                return frame
            data, self.raw = self.raw, b""
            return frame._replace(data=data)

    return SentRaw


def operations(shape: type[PendingOperation], *commands: str) -> type[ClientCore]:
    """The operations of these commands, or of all two-stage commands, have another class."""

    class Operations(ClientCore):
        def command(self, name: str, value: Any = None) -> PendingOperation:
            if name in commands or (not commands and BY_NAME[name].two_stage):
                return shape(BY_NAME[name], value, self.dialect)
            return super().command(name, value)

    return Operations


def loss_is_success(command: str) -> type[ClientCore]:
    """A command that was not answered before the link was lost succeeds."""

    class LossIsSuccess(ClientCore):
        def connection_lost(self, reason: str, now_s: float) -> list[Event]:
            events: list[Event] = []
            for operation in tuple(self._open):
                if operation.command.name == command:
                    operation.settle(None)
                    events += self._after_step(operation, now_s)
            return events + super().connection_lost(reason, now_s)

    return LossIsSuccess


def reply_data(command: str, change: Change) -> type[ClientCore]:
    """The data of first replies to one command are changed before they are decoded."""

    class ReplyData(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            return super()._dispatch(_changed(frame, command, change), now_s)

    return ReplyData


def result_data(change: Change) -> type[ClientCore]:
    """The data of all final results are changed before they are decoded."""

    class ResultData(ClientCore):
        def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
            if frame.tagged:
                frame = frame._replace(data=_change_data(change, frame.data))
            return super()._dispatch(frame, now_s)

    return ResultData


def returned(method: str, change: Callable[[Any], Any]) -> type[AsyncClient]:
    """A method of the client returns a changed value."""

    async def call(client: AsyncClient, *args: Any) -> Any:
        return change(await getattr(super(changed, client), method)(*args))

    changed: type[AsyncClient] = type("Returned", (AsyncClient,), {method: call})
    return changed


def refusal_returns(method: str, value: Any) -> type[AsyncClient]:
    """A method of the client returns a value after a refusal."""

    async def call(client: AsyncClient, *args: Any) -> Any:
        try:
            return await getattr(super(changed, client), method)(*args)
        except Refused:
            return value

    changed: type[AsyncClient] = type("RefusalReturns", (AsyncClient,), {method: call})
    return changed


def _changed(frame: Frame, command: str, change: Change) -> Frame:
    if frame.tagged or frame.opcode != BY_NAME[command].opcode:
        return frame
    return frame._replace(data=_change_data(change, frame.data))


def _change_data(change: Change, data: bytes) -> bytes:
    return change.get(data, data) if isinstance(change, Mapping) else change(data)
