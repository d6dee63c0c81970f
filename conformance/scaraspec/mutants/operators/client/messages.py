"""Operators that change one message of the reference client, or the value that it returns.

`command` is the name of a row of the command table. A change is a function of the data, or a
table of data and what is sent or read in its place.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, ClassVar

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.errors import Refused
from scaraspec.client.pending_operation import PendingOperation, TwoStage
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


class ReplacesRequests(ClientCore, ABC):
    """One request is not what it should be."""

    name: ClassVar[str]
    """The command in question."""

    @abstractmethod
    def replaced(self, frame: Frame) -> Frame:
        """What is sent in place of the request."""

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._altered, frames))

    def _altered(self, frame: Frame) -> Frame:
        return self.replaced(frame) if frame.opcode == BY_NAME[self.name].opcode else frame


class AltersRequests(ReplacesRequests, ABC):
    """The data of one request are not what they should be."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is sent in place of the data."""

    def replaced(self, frame: Frame) -> Frame:
        """The request with those."""
        return frame._replace(data=self.altered(frame.data))


class AltersFields(AltersRequests, ABC):
    """The fields of one request are not what they should be."""

    @abstractmethod
    def fields(self, fields: list[bytes]) -> list[bytes]:
        """What is sent in their place."""

    def altered(self, data: bytes) -> bytes:
        """Join them."""
        return b"|".join(self.fields(data.split(b"|")))


class SendsUnchecked(AltersFields, ABC):
    """A value that is not to be sent goes out all the same."""

    place: ClassVar[int] = 0
    """Which of the fields."""
    _unchecked: float | None = None

    @abstractmethod
    def passes(self, value: float) -> bool:
        """Whether this one does."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Show the encoder a 1 in its place."""
        self._unchecked = None
        if name == self.name:
            fields = list(value) if isinstance(value, tuple) else [value]
            if self.passes(fields[self.place]):
                self._unchecked, fields[self.place] = fields[self.place], 1
                value = type(value)(*fields)
        return super().command(name, value)

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Put it back."""
        if self._unchecked is not None:
            fields[self.place] = f"{self._unchecked}".encode()
        return fields


class AltersReplies(ClientCore, ABC):
    """The data of one reply are read otherwise than they came."""

    name: ClassVar[str]
    """The command in question."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is read in place of the data."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if not frame.tagged and frame.opcode == BY_NAME[self.name].opcode:
            frame = frame._replace(data=self.altered(frame.data))
        return super()._dispatch(frame, now_s)


class AltersResults(ClientCore, ABC):
    """The data of final results are read otherwise than they came."""

    @abstractmethod
    def altered(self, data: bytes) -> bytes:
        """What is read in place of the data."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged:
            frame = frame._replace(data=self.altered(frame.data))
        return super()._dispatch(frame, now_s)


class OtherTwoStage(ClientCore):
    """Two-stage commands are carried out otherwise."""

    shape: ClassVar[type[TwoStage]]
    """How."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take the other way."""
        if not BY_NAME[name].two_stage:
            return super().command(name, value)
        return self.shape(BY_NAME[name], value, self.dialect)


class TakesLossForSuccess(ClientCore, ABC):
    """A link that is lost before a command was answered is taken for its success."""

    name: ClassVar[str]
    """The command in question."""

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """Take it for that."""
        events: list[Event] = []
        for operation in tuple(self._open):
            if operation.command.name == self.name:
                operation.settle(None)
                events += self._after_step(operation, now_s)
        return events + super().connection_lost(reason, now_s)
